"""Laws with a memory that relaxes: Dahl's and LuGre's bristles, passive, and a lubricating film."""

import numpy as np
import pytest
from fixtures.exact_problems import explained_by, fit_to_all
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.friction import Friction, along, at_rest
from frictionid.friction.laws import Dahl, FilmLag, LuGre, MotorLoad, Stribeck
from frictionid.mechanics import Plant, pendulum

PLANT = Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2})


def at(*w):
    return at_rest(np.reshape(w, (-1, 1)).astype(float))


def dt(seconds):
    return np.array([seconds])


# ---------------------------------------------------------------- Dahl


DAHL = np.array([[0.1, 0.02, 0.01]])


def test_dahl_friction_is_lugre_friction_without_peak_and_damping():
    nodes = synthetic_problem(1).nodes
    lugre = np.array([[0.1, 0.0, 1.0, 0.02, 0.01, 0.0, 0.1]])
    expected = along(Friction(LuGre(), lugre), nodes)
    assert_allclose(along(Friction(Dahl(), DAHL), nodes), expected, rtol=1e-12)


def test_dahl_friction_depends_on_the_way_gone_and_not_on_the_time_it_took():
    law, x = Dahl(), at_rest(np.array([[0.02], [2.0]]))
    (z,) = law.advance(DAHL, x, (np.zeros((2, 1)),), np.array([[0.5], [0.005]]))
    assert_allclose(z[0], z[1], rtol=1e-12)
    assert z[0, 0] == pytest.approx(0.01 * (1 - np.exp(-1)))


def test_dahl_friction_is_passive_with_the_energy_of_its_spring():
    rng = default_rng(0)
    w, z = rng.normal(size=(500, 1)), 0.01 * rng.uniform(-1, 1, (500, 1))
    torque = Dahl().torque(DAHL, at_rest(w), (z,))
    stored = 0.1 / 0.01 * z * (w - np.abs(w) * z / 0.01)
    assert (w * torque - stored >= -1e-12).all()


LOADED = np.array([[0.1, 0.02, 0.01, 0.15], [0.05, 0.03, 0.004, 0.3]])


def test_under_load_it_is_dahl_friction_of_a_level_that_grows_with_the_torque():
    nodes = synthetic_problem(2).nodes
    idle = nodes._replace(inputs=nodes.inputs._replace(u=0.0 * nodes.inputs.u))
    assert_allclose(
        along(Friction(Dahl(motor_load=True), LOADED), idle),
        along(Friction(Dahl(), LOADED[:, :3]), idle),
        rtol=1e-12,
    )
    # sliding for long it is that of a gear under load
    x = at_rest(np.full((1, 2), 3.0))._replace(u=np.array([[0.7, -0.4]]))
    z = (LOADED[:, 2] * np.ones((1, 2)),)
    expected = MotorLoad().torque(LOADED[:, [0, 1, 3]], x, ())
    assert_allclose(Dahl(motor_load=True).torque(LOADED, x, z), expected, rtol=1e-9)


# ---------------------------------------------------------------- LuGre

# coulomb, peak, stribeck_velocity, viscous, presliding, damping, damping_velocity
THETA = np.array([[0.1, 0.06, 1.5, 0.02, 0.01, 0.3, 0.5]])
STIFFNESS = 0.16 / 0.01


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


def test_before_it_slips_a_joint_is_a_spring_with_a_damper():
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


def bristles(theta, w, z):
    """Stiffness, and the rate at which bristles bend."""
    stiffness = (theta[..., 0] + theta[..., 1]) / theta[..., 4]
    level = theta[..., 0] + theta[..., 1] * np.exp(-((w / theta[..., 2]) ** 2))
    return stiffness, w - stiffness * np.abs(w) * z / level


def taken(theta, w, z, torque):
    """Power that friction takes beyond what its bristles store [W], over what goes in and out."""
    stiffness, bending = bristles(theta, w, z)
    stored = stiffness * z * bending
    return (w * torque - stored) / (np.abs(w * torque) + np.abs(stored) + 1e-300)


def test_lugre_friction_is_passive_with_the_energy_of_its_bristles_whatever_its_parameters():
    theta, w, z = drawn(default_rng(0))
    assert taken(theta, w, z, LuGre().torque(theta, at_rest(w), (z,))).min() > -1e-9
    stiffness, bending = bristles(theta, w, z)
    constant = stiffness * z + theta[..., 5] * bending + theta[..., 3] * w
    assert taken(theta, w, z, constant).min() < -0.1  # the law as it is often written


def test_under_a_load_below_its_level_a_joint_gives_but_does_not_creep():
    friction = Friction(LuGre(), THETA)
    start = State(np.zeros(1), np.zeros(1), (np.zeros(1),))
    u = np.full((30, 1), 0.06)  # of 0.16
    motion = rollout(PLANT, friction, start, u, np.full(30, 1 / 60))
    assert 0.06 / (STIFFNESS + 0.2) < motion.q[-1, 0] < THETA[0, 4]
    assert abs(motion.q[-1, 0] - motion.q[15, 0]) < 1e-6


def test_lugre_friction_of_size_zero_is_none():
    theta = np.array([[0.0, 0.0, 1.0, 0.0, 0.01, 0.5, 0.1]])
    nodes = synthetic_problem(1).nodes
    assert_array_equal(along(Friction(LuGre(), theta), nodes), 0.0 * nodes.inputs.w)


# ---------------------------------------------------------------- film


FILM = np.array([[0.1, 0.06, 1.5, 0.02, 0.05]])
FILM_BOTH_WAYS = np.array(
    [[0.1, 0.12, 0.06, 0.05, 1.5, 0.02, 0.03], [0.05, 0.04, 0.04, 0.03, 2.5, 0, 0.1]]
)


def test_the_film_follows_the_speed_exactly():
    law, x = FilmLag(), at(-3.0)
    (z,) = law.advance(FILM, x, (np.array([[1.0]]),), dt(0.02))
    assert z[0, 0] == pytest.approx(3.0 - 2.0 * np.exp(-0.02 / 0.05))
    (once,) = law.advance(FILM, x, (z,), dt(0.01))
    (half,) = law.advance(FILM, x, law.advance(FILM, x, (z,), dt(0.004)), dt(0.006))
    assert_allclose(once, half, rtol=1e-15)


def test_friction_never_drives_whatever_the_film_does():
    rng = default_rng(0)
    w, z = rng.normal(scale=3.0, size=(500, 2)), rng.exponential(2.0, (500, 2))
    for law, theta in ((FilmLag(), FILM), (FilmLag(symmetric=False), FILM_BOTH_WAYS)):
        assert (law.torque(theta, at_rest(w), (z,)) * w >= 0).all()


def test_break_away_is_the_torque_just_above_rest_with_the_film_of_this_moment():
    for law, theta in ((FilmLag(1e-9), FILM), (FilmLag(1e-9, symmetric=False), FILM_BOTH_WAYS)):
        z = np.array([[0.3], [1.5], [8.0]])
        for side in (1.0, -1.0):
            level = law.limit(theta, at_rest(side + 0.0 * z), (z,))
            near = side * law.torque(theta, at_rest(side * 1e-6 + 0.0 * z), (z,))
            assert_allclose(level + 0.0 * near, near, rtol=1e-6)


def test_a_joint_that_has_just_moved_fast_slips_under_a_load_that_holds_it_later():
    friction = Friction(FilmLag(), FILM)
    u, steps = np.full((60, 1), 0.13), np.full(60, 1 / 60)  # between the levels 0.10 and 0.16
    for film, slips in ((20.0, True), (0.0, False)):
        start = State(np.zeros(1), np.zeros(1), (np.array([film]),))
        motion = rollout(PLANT, friction, start, u, steps)
        assert (np.abs(motion.q).max() > 1e-3) == slips
        assert motion.w[-1, 0] == 0.0


def test_friction_without_memory_has_the_least_lag_there_is():
    problem = explained_by(Stribeck(), FILM[:, :-1])
    found = fit_to_all(LeastSquares(FilmLag()), problem)
    assert found.theta[0, 0, 4] == FilmLag().bounds[4][0]
    # along recorded nodes a film sees the mean of both ends: half an interval of lag remains
    assert_allclose(found.theta[0, :, :4], FILM[:, :-1], rtol=0.05)
