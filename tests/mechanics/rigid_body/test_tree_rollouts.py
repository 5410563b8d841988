"""Free motion of random trees is that of Pinocchio, integrated by SciPy: to 1e-9."""

import numpy as np
import pytest
from fixtures.random_robots import beside_pinocchio, random_robot
from scipy.integrate import solve_ivp

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction
from frictionid.mechanics import Plant

pin = pytest.importorskip("pinocchio", reason="the test extra installs it")
SECONDS, STEPS = 0.05, 400


def end_of(model, u, q, w):
    """Angles and velocities after the motion, by Pinocchio's accelerations."""
    data, n = model.createData(), len(q)

    def slope(_, x):
        return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], u)])

    start = np.concatenate([q, w])
    return solve_ivp(slope, (0.0, SECONDS), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@pytest.mark.parametrize("seed", [0, 2, 4])
def test_free_motion_of_mixed_branching_trees_agrees(seed, tmp_path):
    rng = np.random.default_rng([7, seed])
    n = 3 + seed % 5
    parts = random_robot(rng, n)
    kinds = {p.kind for p in parts}
    machine, model, _ = beside_pinocchio(tmp_path, parts, rng)
    assert kinds <= {"revolute", "prismatic"} and len(kinds) == len(set(machine.position_units))
    q, w, u = rng.uniform(-1, 1, n), rng.uniform(-2, 2, n), rng.normal(scale=3.0, size=n)
    plant = Plant.from_parameters(machine, machine.nominal())
    none, each = Friction(NoFriction(), np.zeros((n, 0))), np.full(STEPS, SECONDS / STEPS)
    motion = rollout(plant, none, State(q, w), np.tile(u, (STEPS, 1)), each)
    ours = np.concatenate([motion.q[-1], motion.w[-1]])
    end = end_of(model, u, q, w)
    assert np.abs(ours - end).max() <= 1e-9 * max(1.0, np.abs(end).max())
    assert np.abs(end[:n] - q).max() > 0.01  # it moved
