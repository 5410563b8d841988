"""Joints at rest: set-valued friction at zero velocity, no creep, no gain of energy."""

from itertools import product

import numpy as np
import pytest
from fixtures.steps import step, substeps
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from frictionid.arrays import times
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import Instant, State
from frictionid.dynamics.torque_balance import Balance, Stiction, sticking_torque
from frictionid.dynamics.zero_crossing import Substep, after_crossing
from frictionid.friction import Friction, Inputs
from frictionid.friction.laws import CoulombViscous, Stribeck
from frictionid.mechanics import Plant, acrobot, double_pendulum, pendulum

# 0.01 kg m^2 without gravity: a rotor on which torques are loads
ROTOR = Plant.from_parameters(pendulum(), {"mass": 1.0, "length": 0.1, "g": 0.0})
INERTIA = 0.01
DOUBLE = Plant.from_parameters(double_pendulum(), {})
# break-away 0.1 for positive and 0.06 for negative velocities, sliding levels 0.07 and 0.05
UNEQUAL = Friction(Stribeck(symmetric=False), [[0.07, 0.05, 0.03, 0.01, 1.0, 0.0]])


def coulomb(*levels, width=0.02):
    return Friction(CoulombViscous(width=width), [[level, 0.0] for level in levels])


def held_for(duration, plant, friction, q, u, count=2500):
    """State after the joints were left at rest at q under the torques u, shape (..., n)."""
    begin = State(np.broadcast_to(q, np.shape(u)).astype(float), np.zeros(np.shape(u)))
    return begin, step(plant, friction, begin, np.asarray(u), np.array([duration]), count)


# ---------------------------------------------------------------- one joint


def test_a_load_below_break_away_moves_nothing_and_one_above_does():
    loads = np.array([0.0, 0.05, 0.099999, -0.059999, 0.1001, -0.0601])[:, None]
    begin, end = held_for(10.0, ROTOR, UNEQUAL, 0.3, loads)
    assert_array_equal(end.q[:4], begin.q[:4])
    assert_array_equal(end.w[:4], 0.0)
    # just above break-away dw/dt = 0.01 + peak/inertia (w/ws)^2: in 10 s w grows beyond 0.1
    assert end.w[4, 0] > 0.1 and end.q[4, 0] > 0.3
    assert end.w[5, 0] < -0.1 and end.q[5, 0] < -0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.9, 0.98])
@pytest.mark.parametrize("speed", [0.003, 0.3, 1.0])
def test_coulomb_friction_stops_a_rotor_when_and_where_it_should(speed, share, side):
    # dw/dt = -(level - load)/J, whatever the width of the smoothed sign
    level, load = 0.1, share * 0.1
    slowing = (level - load) / INERTIA
    count = substeps(ROTOR, coulomb(level), 1 / 60)
    samples = int(1.2 * 60 * speed / slowing) + 3
    u = np.full((samples, 1), side * load)
    begin = State(np.zeros(1), np.array([side * speed]))
    motion = rollout(ROTOR, coulomb(level), begin, u, np.full(samples, 1 / 60))
    stopped = int(np.argmax(motion.w[:, 0] == 0.0))
    assert (motion.w[stopped:] == 0.0).all() and motion.w[-1, 0] == 0.0
    assert stopped - 1 <= 60 * speed / slowing + 1 / count and stopped >= 60 * speed / slowing - 0.1
    # what little the smoothed sign lacks above 0.1 rad/s shows in the angle
    assert side * motion.q[-1, 0] == pytest.approx(speed**2 / 2 / slowing, rel=5e-4)


def slide_and_stick(plant, level, q, w):
    """Angle at which a pendulum with set-valued Coulomb friction comes to rest, slide by slide."""
    inertia, gravity = plant.p

    def rate(_, y, side):
        return [y[1], (-gravity * np.sin(y[0]) - side * level) / inertia]

    def turn(_, y, side):  # noqa: ARG001
        return y[1]

    turn.terminal = True
    side = np.sign(w)
    while True:
        turn.direction = -side
        found = solve_ivp(rate, (0, 50), [q, w], "DOP853", args=(side,), events=turn, rtol=1e-10)
        q, w = found.y[0, -1], 0.0
        if abs(gravity * np.sin(q)) <= level:
            return q
        side = -np.sign(q)


def test_a_pendulum_comes_to_rest_where_set_valued_friction_lets_it():
    plant = Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2})
    rng = default_rng(1)
    q, w = rng.uniform(-2.5, 2.5, (8, 1)), rng.uniform(-8, 8, (8, 1))
    exact = [slide_and_stick(plant, 0.02, a, b) for a, b in zip(q[:, 0], w[:, 0], strict=True)]
    for width in (0.02, 0.005):  # the smoothing of the sign is no part of the physics
        end = rollout(
            plant, coulomb(0.02, width=width), State(q, w), np.zeros((300, 1)), np.full(300, 0.02)
        )
        assert_array_equal(end.w[-1], 0.0)
        assert_allclose(end.q[-1, :, 0], exact, rtol=0, atol=3e-6)


# ---------------------------------------------------------------- coupled joints


def test_two_joints_stay_while_both_loads_are_below_and_each_breaks_away_on_its_own():
    q = np.array([0.3, -0.5])
    _, h = DOUBLE.dynamics(q, 0 * q)
    friction = coulomb(0.3, 0.1)
    below = np.array([[a * 0.2999, b * 0.0999] for a, b in product((1, -1), repeat=2)])
    begin, end = held_for(2.0, DOUBLE, friction, q, below - h, count=500)
    assert_array_equal(end.q, begin.q)
    assert_array_equal(end.w, 0.0)
    above = np.array([[0.31, 0.0], [-0.31, 0.0], [0.0, 0.11], [0.0, -0.11]])
    begin, end = held_for(0.05, DOUBLE, friction, q, above - h, count=100)
    moved = end.q - begin.q
    assert_array_equal(moved[:2, 1], 0.0)
    assert_array_equal(moved[2:, 0], 0.0)
    assert (moved[:2, 0] * [1, -1] > 0).all() and (moved[2:, 1] * [1, -1] > 0).all()


def substep(begin, u, dt=1e-5):
    """State of the coupled joints after one short step."""
    return step(DOUBLE, coulomb(0.3, 0.1), begin, u, np.array([dt]), 1)


def test_a_motion_that_has_diverged_does_not_end_the_search_of_others():
    rng = default_rng(5)
    q = rng.uniform(-np.pi, np.pi, (2000, 2))
    _, h = DOUBLE.dynamics(q, 0 * q)
    load = rng.uniform(-2.0, 2.0, (2000, 2)) * [0.3, 0.1]
    begin = State(q, 0 * q)
    end = substep(begin, load - h)
    load[0] = np.nan
    broken = substep(begin, load - h)
    assert_array_equal(broken.w[1:], end.w[1:])


def sliding_case(rng, speed, size=400):
    """Joint 1 at rest, joint 2 slow, loads on both; what holds joint 1 while joint 2 slides."""
    q = rng.uniform(-np.pi, np.pi, (size, 2))
    w = np.stack([np.zeros(size), speed * rng.choice([-1.0, 1.0], size)], axis=1)
    M, h = DOUBLE.dynamics(q, w)
    load = rng.uniform(-0.9, 0.9, (size, 2)) * [0.3, 0.1]
    a2 = (load[:, 1] - np.sign(w[:, 1]) * 0.1) / M[:, 1, 1]
    return State(q, w), load - h, load, load[:, 0] - M[:, 0, 1] * a2


def test_a_joint_at_rest_feels_that_the_other_slides():
    begin, u, load, hold = sliding_case(default_rng(6), 0.05)
    end = substep(begin, u, 1e-6)
    held = np.abs(hold) < 0.3
    assert_array_equal(end.w[:, 0] == 0.0, held)
    assert (np.abs(load[~held]) < [0.3, 0.1]).all() and 20 < held.sum() < 380
    assert (np.abs(end.w[:, 1]) < 0.05).all()  # friction slows joint 2, whatever its load


def test_a_joint_stops_by_its_own_load_while_the_other_is_held():
    begin, u, _, hold = sliding_case(default_rng(7), 1e-7)
    # more load on joint 2, against its motion: it turns round in this substep, or stops
    more = default_rng(8).uniform(0.0, 1.0, len(u))
    _, h = DOUBLE.dynamics(begin.q, begin.w)
    u[:, 1] = -np.sign(begin.w[:, 1]) * 0.2 * more - h[:, 1]
    end = substep(begin, u)
    held = end.w[:, 0] == 0.0
    assert 20 < held.sum()
    assert_array_equal(end.w[held, 1] == 0.0, 0.2 * more[held] < 0.1)


def test_a_joint_stops_by_its_own_load_while_the_other_slides():
    rng = default_rng(9)
    begin, u, load, _ = sliding_case(rng, 1e-7)
    begin.w[:, 0] = 0.05 * rng.choice([-1.0, 1.0], len(u))
    M, h = DOUBLE.dynamics(begin.q, begin.w)
    level, way = np.array([0.3, 0.1]), np.sign(begin.w)
    a = np.linalg.solve(M, (load - way * level)[..., None])[..., 0]
    hold = load[:, 1] - M[:, 1, 0] * (load[:, 0] - way[:, 0] * 0.3) / M[:, 0, 0]
    end = substep(begin, load - h)
    turns = way[:, 1] * (begin.w[:, 1] + 1e-5 * a[:, 1]) < 0
    assert 20 < turns.sum() < 380
    assert_array_equal(end.w[turns, 1] == 0.0, np.abs(hold[turns]) < 0.1)


def compound(q2, p):
    """Pendulum of the double pendulum with joint 2 fixed, and the angle by which it is turned."""
    first = p["m1"] * p["r1"] + p["m2"] * p["l1"]
    second = p["m2"] * p["r2"]
    inertia = p["I1"] + p["I2"] + p["m2"] * p["l1"] ** 2 + 2 * second * p["l1"] * np.cos(q2)
    turned = np.arctan2(second * np.sin(q2), first + second * np.cos(q2))
    lever = np.hypot(first + second * np.cos(q2), second * np.sin(q2))
    mass = p["m1"] + p["m2"]
    parameters = {"mass": mass, "length": lever / mass, "inertia": inertia - lever**2 / mass}
    return Plant.from_parameters(pendulum(), parameters), turned


@pytest.mark.parametrize("width", [0.02, 1.0])
def test_a_stuck_joint_is_no_joint_and_breaks_away_when_the_swing_loads_it_enough(width):
    q2, level = 0.7, 0.25
    single, turned = compound(q2, DOUBLE.parameters)
    begin = State(np.array([1.5, q2]), np.array([2.0, 0.0]))
    u, dt = np.zeros((400, 2)), np.full(400, 0.001)
    alone = rollout(single, coulomb(0.0), State(begin.q[:1] + turned, begin.w[:1]), u[:, :1], dt)
    q = np.stack([alone.q[:, 0] - turned, np.full(401, q2)], axis=1)
    w = np.stack([alone.w[:, 0], np.zeros(401)], axis=1)
    M, h = DOUBLE.dynamics(q, w)
    load = h[:, 1] - M[:, 1, 0] * h[:, 0] / M[:, 0, 0]
    first = int(np.argmax(np.abs(load) > level))
    assert 20 < first < 390
    motion = rollout(DOUBLE, coulomb(0.0, level, width=width), begin, u, dt)
    assert_array_equal(motion.q[:first, 1], q2)
    assert_array_equal(motion.w[:first, 1], 0.0)
    assert_allclose(motion.q[:first, 0], q[:first, 0], rtol=0, atol=1e-6)
    assert (motion.w[first + 2 : first + 20, 1] * np.sign(load[first]) > 0).all()


def test_stopping_keeps_the_momentum_of_free_joints_and_never_adds_energy():
    rng = default_rng(3)
    q, before = rng.uniform(-np.pi, np.pi, (200, 2)), rng.uniform(-5, 5, (200, 2))
    after = before * rng.uniform(-0.5, 1.5, (200, 2))  # some joints have crossed zero
    crossed = before * after < 0
    friction = Friction(CoulombViscous(), np.stack([1e4 * crossed, 0.0 * q], axis=-1))
    behind = Instant(DOUBLE, friction, State(q, after), np.zeros((200, 2)))
    part = Substep(State(q, before), behind, Stiction(np.sign(before)), np.array([1e-3]))
    end = after_crossing(part)[0]
    assert_array_equal(end.w == 0.0, crossed)
    M, _ = DOUBLE.dynamics(q, after)
    change = times(M, end.w - after)
    one = crossed.sum(axis=1) == 1
    assert one.sum() > 50 and np.abs(change[crossed]).max() > 1e-3
    assert_allclose(change[one][~crossed[one]], 0.0, atol=1e-12)
    energy = (end.w * times(M, end.w)).sum(-1), (after * times(M, after)).sum(-1)
    assert (energy[0] <= energy[1] + 1e-12).all()
    untouched = ~crossed.any(axis=1)
    assert_array_equal(end.w[untouched], after[untouched])


# ---------------------------------------------------------------- energy

MACHINES = {
    "pendulum": (Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2}), coulomb(0.01)),
    "double": (
        DOUBLE,
        Friction(Stribeck(), [[0.1, 0.03, 1.5, 0.01], [0.05, 0.04, 0.7, 0.0]]),
    ),
    "acrobot": (Plant.from_parameters(acrobot(), {}), coulomb(0.165, 0.055)),
}


@pytest.mark.parametrize("name", MACHINES)
def test_without_input_energy_falls_until_all_joints_rest_within_the_band_for_good(name):
    plant, friction = MACHINES[name]
    rng = default_rng(4)
    q = rng.uniform(-3, 3, (12, plant.n))
    w = rng.uniform(-6, 6, (12, plant.n))
    length = 700 if name == "pendulum" else 420
    u, dt = np.zeros((length, plant.n)), np.full(length, 1 / 60)
    motion = rollout(plant, friction, State(q, w), u, dt)
    energy = plant.terms(motion.q, motion.w).energy
    assert np.diff(energy, axis=0).max() <= 1e-12 * np.ptp(energy)
    rests = (motion.w == 0.0).all(axis=-1)
    assert rests[-1].all()
    _, load = plant.dynamics(motion.q, motion.w)
    x = Inputs(motion.q, 0 * load, 0 * load, 0 * load)
    below = (np.abs(load) < friction.law.limit(friction.theta, x, ())).all(axis=-1)
    # for an instant all joints may rest before one falls again
    assert_array_equal(rests[1:][rests[:-1]], below[:-1][rests[:-1]])


# ---------------------------------------------------------------- joints that stick at once


def held_by_cases(one):
    """Friction (n,) that holds n joints as far as its levels allow, by trying all cases.

    Each joint is held, a = 0, or its friction is at a level and it accelerates against it.
    """
    A = np.linalg.inv(one.M)
    for sides in product((0, -1, 1), repeat=len(A)):
        held = np.array(sides) == 0
        Tf = np.where(np.array(sides) > 0, one.high, -one.low)
        if held.any():
            known = A[held] @ one.f - A[np.ix_(held, ~held)] @ Tf[~held]
            Tf[held] = np.linalg.solve(A[np.ix_(held, held)], known)
        a = A @ (one.f - Tf)
        within = (Tf >= -one.low - 1e-12) & (Tf <= one.high + 1e-12)
        if within.all() and (a[~held] * np.array(sides)[~held] >= -1e-12).all():
            return Tf, held
    raise AssertionError("no case fits")


@pytest.mark.parametrize("n", [2, 3])
def test_joints_that_stick_at_once_are_held_as_all_cases_tried_say(n):
    rng = default_rng(21)
    kinds = set()
    for _ in range(300):
        low, high = rng.uniform(0.2, 1.0, (2, n))
        M = np.eye(n) * rng.uniform(1.0, 2.0, n)
        M = M + np.triu(rng.uniform(-0.45, 0.45, (n, n)), 1)
        M = np.triu(M) + np.triu(M, 1).T
        one = Balance(M, rng.normal(size=n), np.zeros(n), low, high)
        expected, held = held_by_cases(one)
        found = sticking_torque(one, np.ones(n, dtype=bool))
        assert_allclose(found, expected, atol=1e-7)
        kinds.add(tuple(held))
    assert kinds == set(product((True, False), repeat=n))
