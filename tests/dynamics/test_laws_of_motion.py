"""Laws of any motion with stiction: what is mirrored stays mirrored, breaking away has an order."""

import numpy as np
import pytest
from fixtures.steps import step
from numpy.testing import assert_array_equal

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, LuGre, Stribeck
from frictionid.mechanics import Plant, double_pendulum

PLANT = Plant.from_parameters(double_pendulum(), {})
LEVELS = np.array([[0.6, 0.01], [0.25, 0.01]])
FRICTIONS = {
    "sharp": Friction(CoulombViscous(), LEVELS),
    "wide": Friction(CoulombViscous(width=0.5), LEVELS),
    "stribeck": Friction(Stribeck(), [[0.4, 0.2, 0.3, 0.01], [0.15, 0.1, 0.3, 0.01]]),
    "lugre": Friction(LuGre(), np.tile(LuGre().initial[0], (2, 1))),
}


@pytest.mark.parametrize("name", FRICTIONS)
def test_the_mirrored_motion_is_mirrored(name):
    """Bit for bit: starts at rest and slow ones, under torques around what friction can hold."""
    rng = np.random.default_rng(4)
    q = rng.uniform(-0.6, 0.6, (60, 2))
    w = rng.uniform(-1.0, 1.0, (60, 2)) * rng.choice([0.0, 0.02, 3.0], (60, 2))
    u = rng.uniform(-1.2, 1.2, (20, 60, 2))
    dt = np.full(20, 1 / 60)
    friction = FRICTIONS[name]
    there = rollout(PLANT, friction, State(q, w), u, dt)
    back = rollout(PLANT, friction, State(-q, -w), -u, dt)
    assert_array_equal(back.q, -there.q)
    assert_array_equal(back.w, -there.w)
    assert (there.w == 0.0).any() and (there.w[-1] != 0.0).any()


def test_where_a_joint_breaks_away_the_error_falls_faster_than_the_square_of_the_step():
    """The swing of the first joint loads the second one beyond its level within the step."""
    friction = Friction(CoulombViscous(), [[0.0, 0.0], [0.25, 0.0]])
    u, ms = np.zeros(2), np.full(400, 0.001)
    begin = State(np.array([1.5, 0.7]), np.array([2.0, 0.0]))
    swing = rollout(PLANT, friction, begin, np.zeros((400, 2)), ms)
    first = int(np.argmax(swing.w[:, 1] != 0.0))  # at most a millisecond after it broke away
    errors, changes = [], []
    for length in (24, 12, 6):
        before = State(swing.q[first - length // 3], swing.w[first - length // 3])
        dt = np.array([length * 1e-3])
        coarse, fine = (step(PLANT, friction, before, u, dt, k) for k in (1, 1000))
        assert before.w[1] == 0.0 != fine.w[1]
        errors.append(np.abs(coarse.w - fine.w).max())
        changes.append(abs(fine.w[1]))
    assert errors[0] > 4.0 * errors[1] > 16.0 * errors[2]
    assert errors[2] < 0.2 * changes[2]  # which itself is of second order
