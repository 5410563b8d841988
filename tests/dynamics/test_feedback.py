"""A controller in the step: torques u - K q - B w act on the predicted motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from frictionid.dynamics import rollout as prediction
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import step_size_of
from frictionid.dynamics.tangent import end_states as sensitivities
from frictionid.dynamics.tangent.law_derivatives import FreeTheta, reads_of
from frictionid.dynamics.tangent.tangent import MotionModel, MotorTorque
from frictionid.friction import Friction, Inputs, Law
from frictionid.friction import laws as known
from frictionid.mechanics import Plant, acrobot, double_pendulum, pendulum

COUNT, PIECES, FINE = 240, 4, 4
COUPLED = replace(double_pendulum(), coupled=(("both", (1.0, 1.0)),))
LAWS: dict[str, tuple[Law, list[float]]] = {
    "coulomb": (known.CoulombViscous(), [0.05, 0.01]),
    "an arctangent": (known.CoulombViscous(shape="arctan"), [0.05, 0.01]),
    "motor load": (known.MotorLoad(), [0.05, 0.01, 0.1]),
    "bearing load": (known.LoadDependent(), [0.05, 0.005, 0.01]),
    "bristles": (known.LuGre(), [0.05, 0.03, 1.0, 0.01, 0.02, 0.02, 0.3]),
}


def looped(mechanism, count, K=4.0, B=0.3):
    """Machines under different gains, a few under none."""
    plant = Plant.from_parameters(mechanism, {})
    share = np.linspace(0.0, 1.0, count)[:, None, None] * mechanism.motors
    physical = {k: np.full(count, v) for k, v in plant.parameters.items()}
    plant = replace(plant, parameters=physical, p=np.repeat(plant.p[None], count, 0))
    return replace(plant, feedback=share * np.array([K, B])[:, None])


def states(n):
    q, w = np.random.default_rng(2).normal(size=(2, COUNT, n))
    w[::4] *= 0.05
    w[1::4] = 0.0
    return State(q, w)


PENDULUM, ACROBOT = pendulum(mass=0.5, length=0.3), acrobot()
CASES = [
    *(("coulomb", COUPLED), ("motor load", ACROBOT), ("bearing load", COUPLED)),
    *(("an arctangent", PENDULUM), ("bristles", ACROBOT)),
]


@pytest.mark.parametrize(("law", "mechanism"), CASES)
def test_the_compiled_motion_is_that_of_arrays(law, mechanism, monkeypatch):
    """Also of laws that see the torque of the loop."""
    own, numbers = LAWS[law]
    plant, start = looped(mechanism, COUNT), states(mechanism.n)
    friction = Friction(own, np.tile(np.array(numbers), (plant.parts, 1)))
    u = np.sin(np.arange(12.0)[:, None, None] + start.q) * mechanism.motors
    motions = []
    for many in (10**9, 0):
        monkeypatch.setattr(prediction, "MANY", many)
        motions.append(rollout(plant, friction, start, u, np.full((12, COUNT), 0.01)))
    np.testing.assert_allclose(motions[1].q, motions[0].q, rtol=0, atol=1e-9)
    assert np.array_equal(motions[1].w == 0.0, motions[0].w == 0.0)


def model_of(plant, law, numbers, base):
    n, count = plant.n, len(numbers)
    theta = np.tile(np.array(numbers), (n, 1))
    x = np.random.default_rng(1).normal(size=(8, n))
    free = FreeTheta(np.repeat(np.arange(n), count), np.tile(np.arange(count), n))
    reads = reads_of(law, theta, Inputs(x, x, x, x))
    return MotionModel(plant, Friction(law, theta), free, tuple(range(base)), reads)


def motor_torque(n, change=0.0):
    """A torque that differs between pieces, and its derivative by a bias."""
    u = np.linspace(-0.3, 0.3, PIECES)[:, None, None] * np.linspace(-1, 1, COUNT)[:, None]
    u = u + change + np.zeros((PIECES, COUNT, n))
    return MotorTorque(u, np.ones((PIECES, 1, COUNT, n)))


@pytest.mark.parametrize("law", ["motor load", "bearing load", "bristles"])
def test_compiled_derivatives_are_those_of_arrays(law, monkeypatch):
    plant = looped(double_pendulum(), COUNT)
    model, start = model_of(plant, *LAWS[law], 2), states(2)
    start = start._replace(memory=model.friction.law.start(model.friction.theta, at(start)))
    ends = []
    for many in (10**9, 0):
        monkeypatch.setattr(sensitivities, "COMPILED", many)
        dt = np.full(COUNT, 0.01)
        ends.append(sensitivities.end_states(model, start, motor_torque(2), dt, FINE))
    for name in ("q", "w", "by_start", "by_parameters"):
        routes = (getattr(end, name) for end in ends)
        np.testing.assert_allclose(*routes, rtol=1e-6, atol=1e-8, err_msg=name)


def at(state):
    return Inputs(state.q, state.w, 0.0 * state.q, 0.0 * state.q)


@pytest.mark.parametrize("law", ["an arctangent", "motor load"])
def test_derivatives_are_the_slopes_of_the_ends(law):
    own, numbers = LAWS[law]
    plant, start = looped(double_pendulum(), COUNT), states(2)
    start = start._replace(w=np.sign(start.w + 1e-9) * (2.0 + np.abs(start.w)))  # no stops
    dt = np.full(COUNT, 0.004)

    def ends(q, w, bias, numbers):
        model = model_of(plant, own, [*numbers], 0)
        return sensitivities.end_states(model, State(q, w), motor_torque(2, bias), dt, FINE)

    def slope(change):
        """Difference quotient along a direction in q, w, bias, and theta of both joints."""
        up, down = (
            ends(
                start.q + s * change[:2],
                start.w + s * change[2:4],
                s * float(change[4]),
                np.array(numbers) + s * change[5:],
            )
            for s in (1.0, -1.0)
        )
        return np.concatenate([up.q - down.q, up.w - down.w], axis=-1) / 2e-5

    end, count = ends(start.q, start.w, 0.0, np.array(numbers)), len(numbers)
    theta = end.by_parameters[..., : 2 * count].reshape(COUNT, 4, 2, count).sum(axis=2)
    lines = np.concatenate([end.by_start, end.by_parameters[..., -1:], theta], axis=-1)
    moves = ((end.w * start.w > 0.0) & (np.abs(end.w) > 0.5)).all(axis=-1)
    assert moves.sum() > 0.8 * COUNT
    for k, change in enumerate(1e-5 * np.eye(5 + count)):
        line = lines[moves, :, k]
        error = np.abs(line - slope(change)[moves]) / np.abs(line).max()
        # a motor torque that changes sides in a step has a kink there
        assert error.max() < 2e-2 and np.quantile(error, 0.95) < 1e-3


@pytest.mark.parametrize("K, B", [(20.0, 1.5), (200.0, 0.1)])
def test_a_stiff_joint_moves_as_an_independent_integration_says(K, B):
    """Coulomb friction as a fine smooth step there, as stiction here."""
    machine, levels = pendulum(mass=1.0, length=0.2), (0.3, 0.05)
    plant = replace(Plant.from_parameters(machine, {}), feedback=np.array([[K], [B]]))
    (J, gravity), goal = plant.p, 0.4

    def slope(_, x):
        q, w = x
        friction = levels[0] * np.tanh(w / 1e-4) + levels[1] * w
        return [w, (K * (goal - q) - B * w - gravity * np.sin(q) - friction) / J]

    time = np.linspace(0.0, 1.0, 101)
    truth = solve_ivp(slope, (0, 1), [-0.5, 0.0], "Radau", time, rtol=1e-8, atol=1e-10).y
    friction = Friction(known.CoulombViscous(), np.array([levels]))
    u = np.full((100, 1), K * goal)
    motion = rollout(plant, friction, State(np.array([-0.5]), np.zeros(1)), u, np.full(100, 0.01))
    np.testing.assert_allclose(motion.q[:, 0], truth[0], atol=5e-4)
    q, rests = motion.q[:, 0], motion.w[:, 0] == 0.0
    load = K * (goal - q) - gravity * np.sin(q)
    assert rests[-1] == (B > 1.0) and (np.abs(load[1:][rests[1:]]) < levels[0]).all()


def test_steps_resolve_the_loop():
    """Its damping and its stiffness; a joint without motor has no loop."""
    machine, friction = (
        pendulum(mass=1.0, length=0.1),
        Friction(known.NoFriction(), np.empty((1, 0))),
    )
    plant = Plant.from_parameters(machine, {})  # 0.01 kg m^2

    def pieces(K, B):
        loop = replace(plant, feedback=np.array([[K], [B]]))
        return step_size_of(loop, friction, 0.01).pieces

    assert pieces(0.0, 0.0) == step_size_of(plant, friction, 0.01).pieces == 2
    assert pieces(0.0, 4.0) == 4 and pieces(100.0, 0.0) == 4 and pieces(-1.0, -1.0) == 2
