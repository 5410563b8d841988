"""A simulator's steps are those of predictions, batches are machines alone, MuJoCo agrees."""

import mujoco
import numpy as np
import pytest
import torch
from fixtures.refusals import assert_refused
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.data.plants import Calibration
from frictionid.deploy.simulator import Simulator
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import (
    CoulombViscous,
    FilmLag,
    LuGre,
    PerJoint,
    Stribeck,
    Sum,
    WindowMLP,
)
from frictionid.mechanics import Plant, acrobot, linear_axis, mjcf_of, pendulum

MACHINE, T, DT = acrobot(rotor=2e-6), 40, 0.01
LEVELS = [[0.02, 0.002], [0.03, 0.001]]
LAWS = {
    "coulomb_viscous": CoulombViscous(),
    "stribeck": Stribeck(),
    "film_lag": FilmLag(),
    "lugre": LuGre(),
    "window": WindowMLP(samples=3, sample_time=DT),
}

COMBINED = {
    "static by joint": PerJoint(("stribeck", "coulomb_viscous")),
    "memory in one joint": PerJoint(("film_lag", "coulomb_viscous")),
    "none in one joint": PerJoint(("none", "stribeck")),
    "sum": Sum(("stribeck", "motor_load")),
}


def friction_of(name):
    """A friction whose parameters differ between three machines."""
    law, rng = (LAWS | COMBINED)[name], default_rng(3)
    start = np.array(LEVELS if name == "coulomb_viscous" else law.initial[:1])
    return Friction(law, start * rng.uniform(0.8, 1.2, (3, 2, len(law.names))))


def motion_of(seed):
    rng = default_rng(seed)
    q, w = rng.uniform(-2, 2, (3, 2)), rng.uniform(-3, 3, (3, 2))
    return q, w, 0.2 * rng.standard_normal((T, 3, 2))


@pytest.mark.parametrize("name", LAWS)
def test_steps_are_those_of_a_rollout(name):
    friction, (q, w, u) = friction_of(name), motion_of(1)
    motion = Simulator(MACHINE, friction, dt=DT).run(State(q, w), u)
    plant = Plant.from_parameters(MACHINE, MACHINE.nominal())
    expected = rollout(plant, friction, State(q, w), u, np.full(T, DT))
    assert_array_equal(motion.q, expected.q)
    assert_array_equal(motion.w, expected.w)


@pytest.mark.parametrize("name", LAWS)
def test_a_machine_in_a_batch_moves_as_alone(name):
    friction, (q, w, u) = friction_of(name), motion_of(2)
    m4 = np.array([0.05, 0.08, 0.12])
    together = Simulator(MACHINE, friction, dt=DT, parameters={"m4": m4}).run(State(q, w), u)
    for i in range(3):
        own = Simulator(MACHINE, friction[i], dt=DT, parameters={"m4": float(m4[i])})
        alone = own.run(own.reset(q[i], w[i]), u[:, i])
        # the batch's smallest step is that of its stiffest machine
        assert_allclose(together.q[:, i], alone.q, atol=2e-6)


@pytest.mark.parametrize("name", ["stribeck", *COMBINED])
def test_tensors_move_as_arrays(name):
    friction, (q, w, u) = friction_of(name), motion_of(4)
    arrays = Simulator(MACHINE, friction, dt=DT)
    tensors = Simulator(MACHINE, Friction(friction.law, torch.as_tensor(friction.theta)), dt=DT)
    found = tensors.run(tensors.reset(q, w), u)
    assert isinstance(found.q, torch.Tensor)
    assert_allclose(found.q.numpy(), arrays.run(arrays.reset(q, w), u).q, atol=1e-9)


def test_a_machine_that_diverges_is_nan_and_the_others_go_on():
    friction, (q, w, u) = friction_of("coulomb_viscous"), motion_of(5)
    usual = Simulator(MACHINE, friction, dt=DT)
    expected = usual.run(State(q, w), u)
    w[1] = 1e7
    motion = usual.run(State(q, w), u)
    assert np.isnan(motion.q[1:, 1]).all() and np.isfinite(motion.q[0]).all()
    assert_allclose(motion.q[:, ::2], expected.q[:, ::2], atol=1e-12)


def test_a_calibration_makes_the_machine_heavier():
    law, u = CoulombViscous(), np.full((100, 1), 3.0)
    heavy = Friction(law, [[1.0, 0.0]], calibration=Calibration.ideal(1, np.array([4.0])))
    simulator = Simulator(linear_axis(mass=2.0), heavy)
    assert simulator.run(simulator.reset(), u).w[-1, 0] == pytest.approx((3.0 - 1.0) / 4.0)


HARD = 'solreffriction="0.0002 1" solimpfriction="0.9999 0.99999 0.001 0.5 2"'


def by_mujoco(machine, theta, q, w, u, dt, step):
    """Angles (T + 1, n) with the law as MuJoCo has it: frictionloss and damping."""
    text = mjcf_of(machine, timestep=step).replace("RK4", "implicitfast")
    for name, (coulomb, viscous) in zip(machine.joints, theta, strict=True):
        own = f'frictionloss="{coulomb}" damping="{viscous}" {HARD}'
        text = text.replace(f'<joint name="{name}" type', f'<joint name="{name}" {own} type')
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.tolerance, model.opt.iterations = 1e-14, 200
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, w
    out = [data.qpos.copy()]
    for torque in u:
        data.qfrc_applied[:] = torque
        mujoco.mj_step(model, data, round(dt / step))
        out.append(data.qpos.copy())
    return np.array(out)


def test_mujoco_agrees_on_coulomb_and_viscous_friction():
    """The motion stops on the way; half of MuJoCo's step halves the distance, below 1 mrad."""
    theta, q = [[0.3, 0.01], [0.1, 0.004]], [1.2, -0.6]
    u = 0.05 * np.sin(0.1 * np.arange(150))[:, None] * MACHINE.motors
    simulator = Simulator(MACHINE, Friction(CoulombViscous(), np.array(theta)), dt=0.01)
    motion = simulator.run(simulator.reset(q), u)
    far, near = (
        np.abs(by_mujoco(MACHINE, theta, q, 0.0, u, 0.01, step) - motion.q).max()
        for step in (1e-4, 5e-5)
    )
    assert (motion.w[100:] == 0.0).any()
    assert near < 0.65 * far < 0.65e-3, (near, far)


@pytest.mark.parametrize(
    "arguments, reason",
    [
        ({"friction": "model.json"}, "must be a Friction or a Fit"),
        ({"dt": 0.0}, "dt = 0.0 s must be a positive time"),
        ({"mechanism": pendulum(mass=1.0, length=1.0)}, "that of 2 joints, the pendulum has 1"),
        ({"friction": friction_of("window"), "dt": 0.1}, "reads samples 0.01 s apart"),
        ({"parameters": {"m9": 1.0}}, "no parameter 'm9'"),
        ({"parameters": {"m9": np.ones(3)}}, "no parameter 'm9'"),
    ],
)
def test_what_no_machine_can_be_is_refused(arguments, reason):
    usual = {"mechanism": MACHINE, "friction": friction_of("coulomb_viscous")}
    with assert_refused(reason):
        Simulator(**(usual | arguments))


def test_states_of_another_shape_are_refused():
    simulator = Simulator(MACHINE, friction_of("coulomb_viscous"))
    with assert_refused("q has shape"):
        simulator.reset(q=[1.0])
    with assert_refused("must be numbers"):
        simulator.step(simulator.reset(), ["much", "more"])
