"""Free motion of random trees is that of Pinocchio and MuJoCo, integrated by SciPy: to 1e-9."""

import numpy as np
import pytest
from fixtures.random_robots import beside_pinocchio, mjcf_text, random_robot
from scipy.integrate import solve_ivp

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import NoFriction
from frictionid.mechanics import Plant

pin = pytest.importorskip("pinocchio", reason="the test extra installs it")
mujoco = pytest.importorskip("mujoco", reason="the test extra installs it")
SECONDS, STEPS = 0.05, 400


def by_pinocchio(model, u):
    data = model.createData()
    return lambda q, w: pin.aba(model, data, q, w, u)


def by_mujoco(text, joints, u):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    at = [int(model.joint(name).qposadr[0]) for name in joints]

    def acceleration(q, w):
        data.qpos[at], data.qvel[at], data.qfrc_applied[at] = q, w, u
        mujoco.mj_forward(model, data)
        return data.qacc[at].copy()

    return acceleration


def end_of(acceleration, q, w):
    n = len(q)

    def slope(_, x):
        return np.concatenate([x[n:], acceleration(x[:n], x[n:])])

    start = np.concatenate([q, w])
    return solve_ivp(slope, (0.0, SECONDS), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@pytest.mark.parametrize("seed", [0, 2, 4])
def test_free_motion_of_mixed_branching_trees_agrees(seed, tmp_path):
    rng = np.random.default_rng([7, seed])
    n = 3 + seed % 5
    parts = random_robot(rng, n)
    kinds = {p.kind for p in parts}
    machine, model, rotors = beside_pinocchio(tmp_path, parts, rng)
    assert kinds <= {"revolute", "prismatic"} and len(kinds) == len(set(machine.position_units))
    q, w, u = rng.uniform(-1, 1, n), rng.uniform(-2, 2, n), rng.normal(scale=3.0, size=n)
    plant = Plant.from_parameters(machine, machine.nominal())
    none, each = Friction(NoFriction(), np.zeros((n, 0))), np.full(STEPS, SECONDS / STEPS)
    motion = rollout(plant, none, State(q, w), np.tile(u, (STEPS, 1)), each)
    ours = np.concatenate([motion.q[-1], motion.w[-1]])
    text = mjcf_text(parts, [rotors[f"joint_{i}"] for i in range(n)])
    for theirs in (by_pinocchio(model, u), by_mujoco(text, machine.joints, u)):
        end = end_of(theirs, q, w)
        assert np.abs(ours - end).max() <= 1e-9 * max(1.0, np.abs(end).max())
        assert np.abs(end[:n] - q).max() > 0.01  # it moved
