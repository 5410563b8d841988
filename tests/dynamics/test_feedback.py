"""A controller in the step: torques u - K q - B w act on the predicted motion."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.steps import looped
from scipy.integrate import solve_ivp

from frictionid.dynamics import end_states as sensitivities
from frictionid.dynamics.law_derivatives import FreeTheta, reads_of
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import step_size_of
from frictionid.dynamics.tangent import MotionModel, MotorTorque
from frictionid.friction import Friction, Inputs
from frictionid.friction import laws as known
from frictionid.mechanics import Plant, double_pendulum, pendulum

COUNT, PIECES, FINE = 240, 4, 4
LAWS = {
    "an arctangent": (known.CoulombViscous(shape="arctan"), [0.05, 0.01]),
    "motor load": (known.MotorLoad(), [0.05, 0.01, 0.1]),
}


def model_of(plant, law, numbers):
    n, count = plant.n, len(numbers)
    theta = np.tile(numbers, (n, 1))
    x = np.random.default_rng(1).normal(size=(8, n))
    free = FreeTheta(np.repeat(np.arange(n), count), np.tile(np.arange(count), n))
    reads = reads_of(law, theta, Inputs(x, x, x, x))
    return MotionModel(plant, Friction(law, theta), free, (), reads)


def motor_torque(bias):
    """A torque of two motors that differs between pieces, and its derivative by a bias."""
    u = np.linspace(-0.3, 0.3, PIECES)[:, None, None] * np.linspace(-1, 1, COUNT)[:, None]
    u = u + bias + np.zeros((PIECES, COUNT, 2))
    by = np.ones((PIECES, 1, COUNT, 2))
    return MotorTorque(u, by, 0.0 * u, 0.0 * by)


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_are_the_slopes_of_the_ends(law):
    own, numbers = LAWS[law]
    plant, dt = looped(double_pendulum(), COUNT, (4.0, 0.3)), np.full(COUNT, 0.004)
    q, w = np.random.default_rng(2).normal(size=(2, COUNT, 2))
    w[::4] *= 0.05
    w[1::4] = 0.0
    start = np.concatenate([q, np.sign(w + 1e-9) * (2.0 + np.abs(w))], axis=-1)  # no stops

    def ends(nodes, bias, numbers):
        model = model_of(plant, own, numbers)
        return sensitivities.end_states(model, nodes, motor_torque(bias), dt, FINE)

    def slope(change):
        """Difference quotient along a direction in q, w, bias, and theta of both joints."""
        move, bias, numbered = np.split(change, [4, 5])
        up, down = (
            ends(start + s * move, s * float(bias[0]), np.array(numbers) + s * numbered)[0]
            for s in (1.0, -1.0)
        )
        return (up - down) / 2e-5

    (end, by), count = ends(start, 0.0, np.array(numbers)), len(numbers)
    theta = by[..., 4 : 4 + 2 * count].reshape(COUNT, 4, 2, count).sum(axis=2)
    lines = np.concatenate([by[..., :4], by[..., -1:], theta], axis=-1)
    moves = ((end * start > 0.0) & (np.abs(end) > 0.5))[:, 2:].all(axis=-1)
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
    friction = Friction(known.CoulombViscous(), [levels])
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
