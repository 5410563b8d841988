"""Gains of motor currents, base parameters that bodies can have, and loads of gears."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures import driven_wrist as wrist
from fixtures.changed_data import changed
from fixtures.refusals import assert_refused
from fixtures.sines import sines, torque_without_friction
from numpy.random import default_rng
from numpy.testing import assert_allclose

from frictionid.comparison.fit_model import fit_model
from frictionid.comparison.suite_recipes import blocks_of
from frictionid.data.plants import Calibration
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.recipe import INTEGRAL, states_of
from frictionid.fitting.parameter_block import Estimate
from frictionid.fitting.parameters import FrictionBlock, GainBlock, InertiaBlock
from frictionid.fitting.torque_balance import (
    InverseDynamics,
    TorqueSettings,
    fit_torques,
    torque_balance,
)
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, LoadDependent, NoFriction, Stribeck
from frictionid.friction.model_files import load_model, save_model
from frictionid.mechanics import configurations, pendulum, urdf
from frictionid.mechanics.rigid_body.rigid_body_tree import (
    moments_of,
    nearest_consistent,
    pseudo_inertia,
)

GAINS = np.array([1.3, 0.8, 1.15])
FRICTION = np.stack([wrist.COULOMB, wrist.VISCOUS], axis=-1)[:3]


def logged(data, gains=GAINS):
    """The data set as logged by motors whose constants are taken to be smaller by these gains."""
    return changed(data, "torque", lambda u: u / gains)


def fitted(data, *blocks):
    return fit_model(data, LeastSquares(CoulombViscous()), InverseDynamics(blocks=blocks))


def intervals(friction, block):
    estimates = friction.provenance.refined.parameters
    return np.array([e.interval_95 for e in estimates if e.block == block])


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("arm"), gravity=[0.0, 0.0, -9.81], payload="c")


def test_gravity_pins_the_gains(arm):
    """With the nominal bodies held: gains and friction of all joints, within their intervals."""
    friction = fitted(logged(wrist.dataset(arm, wrist.frame(arm))), FrictionBlock(), GainBlock())
    gain = friction.calibration.gain
    assert gain == pytest.approx(GAINS, rel=0.01)
    assert friction.theta == pytest.approx(FRICTION, rel=0.03)
    low, high = intervals(friction, "gain").T
    assert ((low < GAINS) & (GAINS < high)).all() and (high - low < 0.05).all()


def test_a_known_payload_pins_the_gains_of_unknown_bodies(arm):
    """All base parameters are free; without the payload one scale is, and the fit is refused."""
    heavy = arm.with_values({"payload_mass": 3.0, "payload_x": 0.1})
    frames = {"light": wrist.frame(arm, seed=1), "heavy": wrist.frame(heavy, seed=2)}
    known = {"heavy": {"payload_mass": 3.0, "payload_x": 0.1}}
    data = logged(wrist.dataset(arm, frames, parameters=known))
    friction = fitted(data, FrictionBlock(), InertiaBlock(), GainBlock())
    assert friction.calibration.gain == pytest.approx(GAINS, rel=0.03)
    alone = replace(data, recordings=data.recordings[:1])
    with assert_refused("only ratios of inertia, gravity and friction"):
        fitted(alone, FrictionBlock(), InertiaBlock(), GainBlock())


LIFT = """<robot name="lift"><link name="base"/>
<link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<link name="b"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="lift" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0"/>
<axis xyz="0 1 0"/></joint></robot>"""


def test_a_slow_vertical_axis_does_not_show_its_gain(tmp_path):
    """Refused by the name of the joint; kept, the other one is found."""
    (tmp_path / "lift.urdf").write_text(LIFT, encoding="utf-8")
    arm, draw = urdf(tmp_path / "lift.urdf"), default_rng(4)
    t = np.arange(0.0, 40.0, 0.01)
    q, w, a = sines(t, ((0.8, 0.15),), ((0.8, 0.43),))
    u = torque_without_friction(arm, q, w, a) + 2.0 * np.sign(w) + 1.0 * w
    u += 0.05 * draw.standard_normal(u.shape)
    q += 1e-5 * draw.standard_normal(q.shape)
    arrays = {"a": {"time": t, "angle": q, "torque": u}}
    data = logged(Dataset.from_arrays(arrays, arm, hold="linear"), np.array([1.5, 0.7]))
    with assert_refused(r"torque gain of turn is not pinned .*gain\.turn"):
        fitted(data, FrictionBlock(), GainBlock())
    blocks = blocks_of(["friction", "gain"], ["gain.turn"], {}, "here")
    friction = fitted(data, *blocks)
    assert friction.calibration.gain == pytest.approx([1.0, 0.7], rel=0.01)


def test_a_joint_that_is_not_there_cannot_be_kept(arm):
    with assert_refused("no joint 'elbow' to fix; known are one, two, three"):
        fitted(wrist.dataset(arm, wrist.frame(arm)), FrictionBlock(), GainBlock(fixed=("elbow",)))


# --- Consistent bodies ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    return wrist.mechanism(tmp_path_factory.mktemp("arm"))


def least(tree, base):
    """Smallest eigenvalue of M over all positions."""
    return np.linalg.eigvalsh(tree.inertia(base, configurations(tree.n, 9))).min()


def metric(draw, base):
    """Some information, of parameters as large as these."""
    A = draw.standard_normal((3 * len(base), len(base))) / np.maximum(np.abs(base), 0.1)
    return 1e4 * A.T @ A


def rotors(tree, base):
    return [p for name, p in zip(tree.base_names, base, strict=True) if name.startswith("rotor")]


def test_moments_and_pseudo_inertias_make_each_other(tree):
    J = pseudo_inertia(tree.tree.inertia)
    assert_allclose(moments_of(J), tree.tree.inertia, atol=1e-12)
    assert (np.linalg.eigvalsh(J) > 0).all()


def test_what_is_consistent_stays(tree):
    draw = default_rng(0)
    for _ in range(2):
        base = wrist.base_of_other_bodies(tree, draw)
        found = nearest_consistent(tree, base, metric(draw, base))
        assert_allclose(found, base, atol=1e-3 * np.abs(base).max())


def test_what_no_bodies_have_comes_to_the_nearest_that_some_have(tree):
    draw, nominal = default_rng(1), tree.base({})
    wrong = 0
    for _ in range(2):
        wanted = nominal - 1.5 * np.abs(nominal) * draw.uniform(0, 1, len(nominal))
        weight = metric(draw, nominal)
        found = nearest_consistent(tree, wanted, weight)
        wrong += least(tree, wanted) <= 0
        assert least(tree, found) > 0
        assert min(rotors(tree, found), default=0.0) >= 0
        off = found - wanted
        # no step towards other bodies comes nearer: the set is convex
        for share in draw.uniform(0.5, 2.0, 20):
            towards = share * nominal - found
            assert off @ weight @ towards > -1e-2 * (off @ weight @ off)
    assert wrong == 2


def fitted_by(data, **settings):
    method = InverseDynamics(
        blocks=(FrictionBlock(), InertiaBlock()), settings=TorqueSettings(**settings)
    )
    return fit_model(data, LeastSquares(CoulombViscous()), method)


def off(tree, base):
    """How far base parameters are from those that bodies can have."""
    weight = np.diag(1e6 / np.maximum(np.abs(tree.base({})), 0.05) ** 2)
    return float(np.abs(nearest_consistent(tree, base, weight) - base).max())


def test_a_fit_to_little_motion_is_consistent(tree):
    """The free one has bodies that there cannot be, and finds no viscous friction of joint 1."""
    short = wrist.dataset(tree, wrist.frame(tree, seconds=1.5))
    free, held = (fitted_by(short, consistent=flag) for flag in (False, True))
    assert off(tree, free.calibration.base) > 0.1
    base = held.calibration.base
    assert off(tree, base) < 1e-6 and least(tree, base) > 0
    errors = [np.abs(f.theta[:, 1] - wrist.VISCOUS).max() for f in (free, held)]
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("seed", range(2))
def test_a_fit_to_hardly_any_motion_keeps_masses_positive_definite(tree, seed):
    short = wrist.dataset(tree, wrist.frame(tree, seconds=0.8, seed=seed))
    assert least(tree, fitted_by(short).calibration.base) > 0


def test_a_fit_that_is_consistent_anyway_stays(tree):
    data = wrist.dataset(tree, wrist.frame(tree, seconds=3.0))
    free, held = (fitted_by(data, consistent=flag) for flag in (False, True))
    assert_allclose(held.calibration.base, free.calibration.base, atol=1e-6)
    assert_allclose(held.theta, free.theta, rtol=1e-4)


def test_mechanisms_without_bodies_are_refused():
    t = np.arange(0.0, 4.0, 0.01)
    one = {"time": t, "angle": np.sin(2 * t), "torque": np.cos(2 * t)}
    data = Dataset.from_arrays({"a": one}, pendulum(mass=0.5, length=0.3))
    with assert_refused("needs the bodies of a URDF or MJCF"):
        fitted_by(data, consistent=True)


# --- Loads of gears -------------------------------------------------------------------------------

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
def geared(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return urdf(path).with_values({"rotor_one": 0.2, "rotor_two": 0.1})


def fitted_load(geared, loss, by_pose=(0.0, 0.0)):
    """Load-dependent friction of 12 s of motion, and the loads: torques beyond the rotors.

    loss : share of the loads ; by_pose : growth of the Coulomb levels with cos^2 of joint two
    """
    t = np.arange(0.0, 12.0, 0.002)
    q, w, a = sines(t, ((0.9, 1.1), (0.4, 2.3)), ((1.1, 1.7), (0.5, 2.9)))
    needed = torque_without_friction(geared, q, w, a)
    load = np.abs(needed - [0.2, 0.1] * a)
    coulomb = COULOMB * (1.0 + by_pose * np.cos(q[:, 1:]) ** 2)
    u = needed + (coulomb + loss * load) * np.sign(w) + VISCOUS * w
    noise = default_rng(0).normal(scale=1e-5, size=q.shape)
    data = Dataset(
        "geared", geared, (Recording("a", Signal(t, q + noise), Signal(t, u, "linear")),)
    )
    balance = torque_balance(data, states_of(data, INTEGRAL.states, None), 0.05, 0.004)
    fit = fit_torques(LeastSquares(LoadDependent()), balance, (FrictionBlock(),), TorqueSettings())
    return fit.friction, load


def test_the_share_that_a_gear_swallows_is_found(geared, tmp_path):
    """The load is the torque beyond the rotor; the motor's own would explain friction by itself."""
    found, _ = fitted_load(geared, LOSS)
    by_name = dict(zip(found.law.names, found.theta.T, strict=True))
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
    geared = urdf(tmp_path / "arm.urdf").with_values({"rotor_one": 0.2, "rotor_two": 0.1})
    found, load = fitted_load(geared, np.array([0.12, 0.0]), by_pose=(0.0, 0.1))
    assert load[:, 1].mean() < 2e-4
    coulomb, coefficient, _ = found.theta.T
    assert_allclose(coefficient, [0.12, 0.0], atol=0.002)
    assert 0.4 < coulomb[1] < 0.44


def test_steps_to_impossible_inertias_stay_on_the_border(geared):
    """However often they are wanted: M keeps a twentieth of that of the bodies."""
    none = Friction(NoFriction(), np.zeros((2, 0)))
    nominal = geared.base({})
    estimate = Estimate(none, Calibration.ideal(2, nominal), geared)
    block, q = InertiaBlock(), configurations(2, 13)
    bodies = geared.inertia(geared.base({"rotor_one": 2e-3, "rotor_two": 1e-3}), q)
    usual = np.linalg.inv(np.linalg.cholesky(bodies))
    rng = default_rng(0)
    for _ in range(30):
        own = block.parameters(estimate)
        wanted = [p.value - 3.0 * abs(p.value) * rng.uniform() - 0.01 for p in own]
        estimate = block.with_values(estimate, list(zip(own, wanted, strict=True)))
        M = geared.inertia(estimate.calibration.base, q)
        least = np.linalg.eigvalsh(usual @ M @ np.swapaxes(usual, -1, -2)).min()
        assert least > 0.05 - 1e-9


def test_the_inertia_of_a_rotor_does_not_become_negative(geared):
    none = Friction(NoFriction(), np.zeros((2, 0)))
    own = InertiaBlock(prior=0.2).parameters(
        Estimate(none, Calibration.ideal(2, geared.base({"rotor_two": 0.0})), geared)
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
    coulomb, peak, velocity, _ = found.friction.theta[0]
    assert velocity >= balance.slowest[0, 0] * (1 - 1e-9)
    assert 0.04 < coulomb and coulomb + peak < 3.0 * 0.10
