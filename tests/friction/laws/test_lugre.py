"""LuGre friction: exact bristles, passive whatever its parameters, in the limit Stribeck's."""

import numpy as np
import pytest
from fixtures.exact_problems import assert_recovered
from fixtures.steps import step, substeps
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.friction import Friction, along, at_rest
from frictionid.friction.laws import CoulombViscous, LuGre
from frictionid.mechanics import Plant, pendulum

# coulomb, peak, stribeck_velocity, viscous, presliding, damping, damping_velocity
THETA = np.array([[0.1, 0.06, 1.5, 0.02, 0.01, 0.3, 0.5]])
BOTH_WAYS = np.array(
    [
        [0.1, 0.12, 0.06, 0.05, 1.5, 0.02, 0.03, 0.1, 0.5],
        [0.05, 0.04, 0.04, 0.03, 2.5, 0.01, 0.01, 0.1, 0.5],
    ]
)
STIFFNESS = 0.16 / 0.01
PLANT = Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2})


def at(*w):
    return at_rest(np.reshape(w, (-1, 1)).astype(float))


def dt(seconds):
    return np.array([seconds])


def test_bristles_follow_their_equation_exactly():
    law, z, h = LuGre(), np.array([[-0.004]]), 1e-6
    slow = z.copy()
    level = 0.1 + 0.06 * np.exp(-((0.7 / 1.5) ** 2))
    for _ in range(10_000):
        slow = slow + h * (0.7 - STIFFNESS * 0.7 * slow / level)
    (exact,) = law.advance(THETA, at(0.7), (z,), dt(0.01))
    assert_allclose(exact, slow, rtol=1e-4)
    parts = law.advance(THETA, at(0.7), law.advance(THETA, at(0.7), (z,), dt(0.003)), dt(0.007))
    assert_allclose(parts[0], exact, rtol=1e-13)


def test_a_joint_at_rest_keeps_its_bend_and_is_held_by_it():
    law, z = LuGre(), (np.array([[0.006]]),)
    assert_array_equal(law.advance(THETA, at(0.0), z, dt(5.0))[0], z[0])
    assert law.torque(THETA, at(0.0), z)[0, 0] == pytest.approx(STIFFNESS * 0.006)
    assert law.limit(THETA, at(1.0), z)[0, 0] == 0.0


def test_before_it_slips_it_is_a_spring_with_a_damper():
    law, theta = LuGre(), THETA * [1, 1, 1, 0, 1, 1, 1]
    (z,) = law.advance(theta, at(1e-3), (np.zeros((1, 1)),), dt(0.1))  # 0.1 mrad of 10
    torque = law.torque(theta, at(1e-3), (z,))[0, 0]
    assert torque == pytest.approx(STIFFNESS * 1e-4 + 0.3 * 1e-3, rel=0.02)


def drawn(rng, count=4000):
    """Parameters of all sizes, also such whose damping alone would drive; velocities and bends."""
    theta = np.exp(rng.uniform(-5, 2, (count, 1, 7)))
    theta[..., 5] *= rng.choice([0.0, 1.0, 1000.0], (count, 1))
    w = rng.normal(size=(count, 1)) * np.exp(rng.uniform(-5, 3, (count, 1)))
    return theta, w, theta[..., 4] * rng.uniform(-1.5, 1.5, (count, 1))


def taken(theta, w, z, torque):
    """Power that friction takes beyond what its bristles store [W], over what goes in and out."""
    stiffness = (theta[..., 0] + theta[..., 1]) / theta[..., 4]
    level = theta[..., 0] + theta[..., 1] * np.exp(-((w / theta[..., 2]) ** 2))
    stored = stiffness * z * (w - stiffness * np.abs(w) * z / level)
    return (w * torque - stored) / (np.abs(w * torque) + np.abs(stored) + 1e-300)


def test_it_is_passive_with_the_energy_of_its_bristles_whatever_its_parameters():
    theta, w, z = drawn(np.random.default_rng(0))
    assert taken(theta, w, z, LuGre().torque(theta, at_rest(w), (z,))).min() > -1e-9
    level = theta[..., 0] + theta[..., 1] * np.exp(-((w / theta[..., 2]) ** 2))
    stiffness = (theta[..., 0] + theta[..., 1]) / theta[..., 4]
    bending = w - stiffness * np.abs(w) * z / level
    constant = stiffness * z + theta[..., 5] * bending + theta[..., 3] * w
    assert taken(theta, w, z, constant).min() < -0.1  # the law as it is often written


@pytest.mark.parametrize("damping", [0.0, 0.02, 2.0])
def test_without_input_machine_and_bristles_lose_energy_until_they_rest(damping):
    friction = Friction(LuGre(), np.array([[0.04, 0.02, 1.5, 0.002, 0.02, damping, 0.5]]))
    state = State(np.array([[1.0], [-2.5]]), np.array([[0.0], [3.0]]), (np.zeros((2, 1)),))
    energies, h = [], np.full((2, 1), 1 / 60)
    count = substeps(PLANT, friction, 1 / 60)
    for _ in range(180):
        bristles = 0.06 / 0.02 * state.memory[0][..., 0] ** 2 / 2
        energies.append(PLANT.terms(state.q, state.w).energy + bristles)
        state = step(PLANT, friction, state, np.zeros((2, 1)), h, count)
    assert np.diff(energies, axis=0).max() < 1e-6 * np.ptp(energies)
    assert np.abs(state.w).max() < (0.3 if damping == 0.0 else 0.02)


def test_under_a_load_below_its_level_a_joint_gives_but_does_not_creep():
    friction = Friction(LuGre(), THETA)
    start = State(np.zeros(1), np.zeros(1), (np.zeros(1),))
    u = np.full((30, 1), 0.06)  # of 0.16
    motion = rollout(PLANT, friction, start, u, np.full(30, 1 / 60))
    assert 0.06 / (STIFFNESS + 0.2) < motion.q[-1, 0] < THETA[0, 4]
    assert abs(motion.q[-1, 0] - motion.q[15, 0]) < 1e-6


def test_with_little_presliding_it_is_coulomb_friction_along_a_motion():
    nodes = synthetic_problem(1).nodes
    expected = along(Friction(CoulombViscous(), THETA[:, [0, 3]]), nodes)
    sliding = np.abs(nodes.inputs.w[:, 0]) > 0.2
    off = []
    for presliding in (1e-2, 1e-3, 1e-4):
        theta = THETA * [1, 0, 1, 1, 0, 0, 1] + [0, 0, 0, 0, presliding, 0, 0]
        torque = along(Friction(LuGre(), theta), nodes)
        off.append(np.abs(torque - expected)[sliding].mean())
    assert off[0] > 5 * off[1] > 25 * off[2]


def test_friction_of_size_zero_is_none():
    theta = np.array([[0.0, 0.0, 1.0, 0.0, 0.01, 0.5, 0.1]])
    nodes = synthetic_problem(1).nodes
    assert_array_equal(along(Friction(LuGre(), theta), nodes), 0.0 * nodes.inputs.w)


@pytest.mark.parametrize("presliding", [0.003, 0.1])
@pytest.mark.parametrize("velocity", [1.5, 4.0])
def test_truth_in_truth_out(presliding, velocity):
    theta = THETA * [1, 1, 0, 1, 0, 1, 1] + [0, 0, velocity, 0, presliding, 0, 0]
    assert_recovered(LuGre(), theta)


def test_truth_in_truth_out_with_two_joints_and_levels_of_each_direction():
    assert_recovered(LuGre(symmetric=False), BOTH_WAYS)
