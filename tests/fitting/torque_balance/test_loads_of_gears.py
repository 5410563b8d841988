"""Friction that grows with what a gear passes on is found from the recorded motion."""

import numpy as np
import pytest
from fixtures.sines import sines, torque_without_friction
from numpy.testing import assert_allclose

from frictionid.data.calibration import Calibration
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.formulation import INTEGRAL, states_of
from frictionid.fitting.parameters import FrictionBlock, InertiaBlock
from frictionid.fitting.parameters.parameter_block import Estimate
from frictionid.fitting.torque_balance import TorqueSettings, fit_torques, torque_balance
from frictionid.friction import Friction
from frictionid.friction.laws import LoadDependent, NoFriction, Stribeck
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import configurations, pendulum, urdf

ARM = """<robot name="arm"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0.02"/><mass value="3"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<link name="b"><inertial><origin xyz="0.15 0.01 0"/><mass value="1.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="one" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
<joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.3 0 0"/>
<axis xyz="0 1 0.5"/></joint></robot>"""
COULOMB, VISCOUS, LOSS = np.array([0.8, 0.4]), np.array([0.3, 0.2]), np.array([0.12, 0.2])


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return urdf(path).with_values({"rotor_one": 0.2, "rotor_two": 0.1})


def fitted(arm, loss, by_pose=(0.0, 0.0)):
    """Load-dependent friction of 12 s of motion, and the loads: torques beyond the rotors.

    loss : share of the loads ; by_pose : growth of the Coulomb levels with cos^2 of joint two
    """
    t = np.arange(0.0, 12.0, 0.002)
    q, w, a = sines(t, ((0.9, 1.1), (0.4, 2.3)), ((1.1, 1.7), (0.5, 2.9)))
    needed = torque_without_friction(arm, q, w, a)
    load = np.abs(needed - np.array([0.2, 0.1]) * a)
    coulomb = COULOMB * (1.0 + by_pose * np.cos(q[:, 1:]) ** 2)
    u = needed + (coulomb + loss * load) * np.sign(w) + VISCOUS * w
    noise = np.random.default_rng(0).normal(scale=1e-5, size=q.shape)
    data = Dataset("arm", arm, (Recording("a", Signal(t, q + noise), Signal(t, u, "linear")),))
    balance = torque_balance(data, states_of(data, INTEGRAL.states, None), 0.05, 0.004)
    fit = fit_torques(LeastSquares(LoadDependent()), balance, (FrictionBlock(),), TorqueSettings())
    return fit.friction, load


def test_the_share_that_a_gear_swallows_is_found(arm, tmp_path):
    """The load is the torque beyond the rotor; the motor's own would explain friction by itself."""
    found, _ = fitted(arm, LOSS)
    by_name = dict(zip(found.law.names, np.asarray(found.theta).T, strict=True))
    assert found.units_at(0) == ("N m", "1", "N m s/rad")  # N m of friction for each of load
    save_model(found, tmp_path / "model.json")
    assert load_model(tmp_path / "model.json").units_at(1) == found.units_at(1)
    assert_allclose(by_name["load_coefficient"], LOSS, rtol=0.02)
    assert_allclose(by_name["viscous"], VISCOUS, rtol=0.02)
    assert_allclose(by_name["coulomb"], COULOMB, rtol=0.03)


def test_friction_by_the_pose_is_no_load_of_a_joint_that_carries_nothing(tmp_path):
    """A wrist's load of 2e-4 N m explained it by a coefficient of 127, which no gear has."""
    balanced = ARM.replace("0.15 0.01 0", "0.1 2e-5 0").replace("0 1 0.5", "1 0 0")
    begin, end = balanced.rsplit('ixx="0.01"', 1)
    (tmp_path / "arm.urdf").write_text(f'{begin}ixx="1e-5"{end}')
    arm = urdf(tmp_path / "arm.urdf").with_values({"rotor_one": 0.2, "rotor_two": 0.1})
    found, load = fitted(arm, np.array([0.12, 0.0]), by_pose=(0.0, 0.1))
    assert load[:, 1].mean() < 2e-4
    coulomb, coefficient, _ = np.asarray(found.theta).T
    assert_allclose(coefficient, [0.12, 0.0], atol=0.002)
    assert 0.4 < coulomb[1] < 0.44


def test_steps_to_impossible_inertias_stay_on_the_border(arm):
    """However often they are wanted: M keeps a twentieth of that of the bodies."""
    none = Friction(NoFriction(), np.zeros((2, 0)))
    nominal = arm.base({})
    estimate = Estimate(none, Calibration.ideal(2, nominal), arm)
    block, q = InertiaBlock(), configurations(2, 13)
    bodies = arm.inertia(arm.base({"rotor_one": 2e-3, "rotor_two": 1e-3}), q)
    usual = np.linalg.inv(np.linalg.cholesky(bodies))
    rng = np.random.default_rng(0)
    for _ in range(30):
        own = block.parameters(estimate)
        wanted = [p.value - 3.0 * abs(p.value) * rng.uniform() - 0.01 for p in own]
        estimate = block.with_values(estimate, list(zip(own, wanted, strict=True)))
        M = arm.inertia(estimate.calibration.base, q)
        least = np.linalg.eigvalsh(usual @ M @ np.swapaxes(usual, -1, -2)).min()
        assert least > 0.05 - 1e-9


def test_the_inertia_of_a_rotor_does_not_become_negative(arm):
    none = Friction(NoFriction(), np.zeros((2, 0)))
    own = InertiaBlock(prior=0.2).parameters(
        Estimate(none, Calibration.ideal(2, arm.base({"rotor_two": 0.0})), arm)
    )
    rotors = [p for p in own if p.name.startswith("rotor")]
    assert rotors and all(p.low == 0.0 and p.value == 0.0 and 0 < p.tolerance < 1 for p in rotors)


def test_a_peak_is_no_larger_than_what_the_slowest_rows_show():
    """Friction that fell off below the speeds of all rows was of any size, 1e106 N m on an arm."""
    t = np.arange(0.0, 20.0, 0.004)
    w = np.where(t < 10.0, 2.0 * np.sin(2.0 * t), 0.055 + 0.013 * np.cos(2.0 * t))
    q = np.concatenate([[0.0], np.cumsum((w[1:] + w[:-1]) / 2 * 0.004)])
    a = np.where(t < 10.0, 4.0 * np.cos(2.0 * t), -0.026 * np.sin(2.0 * t))
    q, w, a = (x[:, None] for x in (q, w, a))
    machine = pendulum(mass=0.5, length=0.2)
    M, h = machine.dynamics(machine.base(machine.nominal()), q, w)
    rubs = (0.06 + 0.04 * (np.abs(w) < 0.048)) * np.sign(w) + 0.01 * w  # more just above rest
    torque = Signal(t, M[..., 0] * a - h + rubs)
    data = Dataset("arm", machine, (Recording("a", Signal(t, q), torque),))
    balance = torque_balance(data, states_of(data, INTEGRAL.states, None), 0.008, 0.004)
    least = np.abs(balance.nodes.inputs.w[balance.stencil]).min(axis=1)[balance.slides]
    assert 0.03 < least.min() < balance.slowest[0, 0]
    found = fit_torques(LeastSquares(Stribeck()), balance, (FrictionBlock(),), TorqueSettings())
    coulomb, peak, velocity, _ = np.asarray(found.friction.theta)[0]
    assert velocity >= balance.slowest[0, 0] * (1 - 1e-9)
    assert 0.04 < coulomb and coulomb + peak < 3.0 * 0.10
