"""The load of a gear is what friction leaves of the motor torque: in fits, predictions, truth."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.random_robots import mechanism as robot
from numpy.testing import assert_allclose

from frictionid.arrays import times
from frictionid.comparison.fit_model import fit_model
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.step import acceleration
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.parameters import FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import Settings, Shooting
from frictionid.fitting.torque_balance import InverseDynamics
from frictionid.friction import Friction
from frictionid.friction.laws import LoadDependent
from frictionid.mechanics import Plant, mechanism_of
from frictionid.simulate import Camera, Controller, Curve, Drive, Fourier, Rig, Run, simulate
from frictionid.simulate.true_friction import LoadFriction

ARM = """<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.2"/>
<mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
</link><joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="9"/></joint></robot>"""
COULOMB, LOAD, VISCOUS = 1.0, 0.08, 0.3


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_the_predicted_load_is_that_of_the_motion_that_follows(share):
    """As inverse dynamics sees it: |M a - h| less the rotor's part, with the friction in a."""
    arm, rng = robot(seed=5, n=3), np.random.default_rng(4)
    plant = Plant.from_parameters(arm, {})
    friction = Friction(LoadDependent(), np.tile([0.5, share, 0.1], (arm.n, 1)))
    q, w, u = rng.normal(size=(3, 200, arm.n))
    w, state = w + np.sign(w), State(q, w + np.sign(w))  # nothing is near rest
    now = Instant(plant, friction, state, 5 * u)
    predicted = now.inputs
    M, h = plant.dynamics(*state[:2])
    follows = plant.load(*state[:2], times(M, acceleration(now)) - h)
    level = np.abs(friction.torque(predicted)).max()
    assert np.abs(predicted.load - follows).max() < 2 * share**2 * level
    alone = plant.load(*state[:2], 5 * u)
    assert np.abs(alone - follows).max() > 0.3 * level


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """Motion of a geared joint whose friction grows by 8 % of the load."""
    folder, draw = tmp_path_factory.mktemp("arm"), np.random.default_rng(1)
    (folder / "arm.urdf").write_text(ARM, encoding="utf-8")
    waves = (tuple(map(float, draw.normal(0, 0.5, 4))) for _ in range(6))
    return simulate(
        Rig(
            "arm",
            {"urdf": str(folder / "arm.urdf"), "parameters": {"rotor_shoulder": 0.1}},
            LoadFriction(Curve((COULOMB,), (COULOMB,), (VISCOUS,)), bearing=(LOAD,)),
            Camera(samples=250, rate=250.0, resolution=2 * np.pi / 2**19),
            tuple(
                Run(str(k), references=(Fourier(next(waves), next(waves), 0.3),)) for k in range(3)
            ),
            drive=Drive(rate=250.0, torque_noise=0.002),
            controller=Controller((200.0,), (20.0,)),
            seed=1,
            substeps=2,
        )
    )


@pytest.mark.parametrize(
    "method",
    [
        Shooting(
            blocks=(FrictionBlock(), InertiaBlock()), settings=Settings(windows=(0.05, 0.1, 0.2))
        ),
        InverseDynamics(),
    ],
    ids=["shooting", "inverse dynamics"],
)
def test_truth_in_truth_out_by_both_methods(moved, method, tmp_path):
    """The described arm lacks what it carries: loads are those of the identified one."""
    (tmp_path / "arm.urdf").write_text(ARM.replace('mass value="2"', 'mass value="1.4"'))
    table = {"urdf": str(tmp_path / "arm.urdf"), "parameters": {"rotor_shoulder": 0.1}}
    described = replace(moved, mechanism=mechanism_of(table))
    fit = fit_model(described, LeastSquares(LoadDependent()), method)
    assert_allclose(fit.theta[0], [COULOMB, LOAD, VISCOUS], rtol=0.02)
    base = moved.mechanism.base({})
    assert_allclose(fit.calibration.base, base, atol=0.005 * np.abs(base).max())
