"""Parts that turn with several joints rub and stick as joints do."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

pytest.importorskip("mujoco")
from fixtures.wrist import motion, wrist

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.mechanics import Body, Joint, Parameter, Plant, from_bodies

T, DT = 100, 0.01


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    return Plant.from_parameters(wrist(tmp_path_factory.mktemp("wrist")), {})


def passive(plant, friction, start, samples=T):
    batch = start.q.shape[:-1]
    return rollout(plant, friction, start, np.zeros((samples, *batch, 2)), np.full(samples, DT))


def states(count, seed=0):
    rng = np.random.default_rng(seed)
    return State(rng.uniform(-1, 1, (count, 2)), rng.normal(scale=3.0, size=(count, 2)))


@pytest.mark.parametrize(
    "theta", [((0.5, 0.05), (0.1, 0.02), (0.3, 0.03)), ((0.2, 0.1), (0.0, 0.05), (0.8, 0.0))]
)
def test_motion_is_that_of_mujoco_with_friction_at_a_tendon(plant, theta):
    k, at_rest = np.arange(T), 0
    u = np.stack([1.5 * np.sin(0.2 * k), 0.5 * np.cos(0.13 * k)], axis=-1)
    start = states(2, 1)
    for q, w in zip(start.q, start.w, strict=True):
        ours = rollout(
            plant, Friction(CoulombViscous(), np.array(theta)), State(q, w), u, 0 * k + DT
        )
        coarse, fine = (motion(theta, q, w, u, DT, step)[0] for step in (4e-5, 2e-5))
        assert_allclose(ours.q, 2 * fine - coarse, atol=4e-4)  # of some radians
        motor = ours.w @ plant.mechanism.friction_map[2]
        at_rest += ((np.abs(motor) < 1e-9) & (np.abs(ours.w) > 0.1).all(-1)).sum()
    assert at_rest > 10  # the motor sticks while both joints move


@pytest.mark.parametrize(
    ("law", "theta"),
    [
        (CoulombViscous(), ((0.5, 0.05), (0.1, 0.02), (0.3, 0.03))),
        (CoulombViscous(width=0.05), ((0.2, 0.0), (0.1, 0.0), (0.3, 0.0))),
        (Stribeck(), ((0.2, 0.1, 0.5, 0.02), (0.0, 0.0, 0.5, 0.0), (0.4, 0.2, 0.5, 0.01))),
    ],
)
def test_energy_only_falls(plant, law, theta):
    found = passive(plant, Friction(law, np.array(theta)), states(5), 50)
    energy = plant.terms(found.q, found.w).energy
    assert (np.diff(energy, axis=0) <= 1e-7 * np.abs(energy).max()).all()
    assert (energy[-1] < energy[0]).all()


def test_an_arm_at_rest_moves_where_its_load_is_outside_of_what_friction_can_hold(plant):
    level, A = np.array([0.5, 0.1, 0.3]), plant.mechanism.friction_map
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (200, 2))
    load = rng.uniform(-1, 1, (200, 2)) * [1.0, 0.5]
    _, h = plant.dynamics(q, 0 * q)
    # loads A' T with |T| below the levels fill a polygon, whose sides are along the rows of A
    normal = A[:, ::-1] * [1.0, -1.0]
    size = np.abs(load @ normal.T) / (np.abs(A @ normal.T).T * level).sum(-1)
    outside = size.max(axis=1)
    assert (outside < 0.98).sum() > 30 and (outside > 1.02).sum() > 30
    friction = Friction(CoulombViscous(), np.stack([level, 0 * level], axis=-1))
    found = rollout(plant, friction, State(q, 0 * q), (load - h)[None], np.full(1, 0.002))
    rests = (found.w[-1] == 0.0).all(axis=-1)
    assert rests[outside < 0.98].all() and not rests[outside > 1.02].any()


def pendulums(absolute):
    """Two rods; the second angle from the vertical, or from the first rod."""
    a, b, mass, length = sp.symbols("a b mass length")
    angle = b if absolute else a + b
    x, y = length * sp.sin(a), -length * sp.cos(a)
    bodies = (
        Body(mass, x, y, mass * length**2 / 10, angle=a, joint=0),
        Body(mass, x + length * sp.sin(angle), y - length * sp.cos(angle), angle=angle, joint=1),
    )
    parameters = (
        Parameter("mass", 0.2, "kg", "of each"),
        Parameter("length", 0.3, "m", "of each"),
        Parameter("g", 9.81, "m/s^2", "gravity"),
    )
    return from_bodies(bodies, (Joint("a", a, "rad"), Joint("b", b, "rad")), parameters)


def test_other_coordinates_give_the_same_motion():
    there = Plant.from_parameters(pendulums(absolute=True), {})
    coupled = replace(pendulums(absolute=False), coupled=(("b from the vertical", (1.0, 1.0)),))
    here = Plant.from_parameters(coupled, {})
    start, law = states(8), CoulombViscous()
    turn = np.array([[1.0, 0.0], [1.0, 1.0]])  # b from the vertical = a + b
    one = passive(there, Friction(law, [[0.1, 0.01], [0.15, 0.005]]), start, 50)
    back = State(start.q @ np.linalg.inv(turn).T, start.w @ np.linalg.inv(turn).T)
    theta = np.array([[0.1, 0.01], [0.0, 0.0], [0.15, 0.005]])
    other = passive(here, Friction(law, theta), back, 50)
    off = np.abs(other.q @ turn.T - one.q)
    assert np.median(off[-1]) < 1e-7 and off.max() < 1e-5
    rests = one.w == 0.0
    assert rests[..., 1].any() and not rests[..., 1].all()
    assert_allclose((other.w @ turn.T)[rests], 0.0, atol=1e-9)
