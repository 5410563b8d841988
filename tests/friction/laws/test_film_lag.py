"""Frictional lag: a film that follows the speed late, and friction that follows the film."""

import numpy as np
import pytest
from fixtures.exact_problems import assert_recovered, everything, explained_by
from numpy.testing import assert_allclose

from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import FilmLag, Stribeck
from frictionid.mechanics import Plant, pendulum

THETA = np.array([[0.1, 0.06, 1.5, 0.02, 0.05]])
BOTH_WAYS = np.array(
    [[0.1, 0.12, 0.06, 0.05, 1.5, 0.02, 0.03], [0.05, 0.04, 0.04, 0.03, 2.5, 0, 0.1]]
)


def at(*w):
    return at_rest(np.reshape(w, (-1, 1)).astype(float))


def dt(seconds):
    return np.array([seconds])


def test_the_film_follows_the_speed_exactly():
    law, x = FilmLag(), at(-3.0)
    (z,) = law.advance(THETA, x, (np.array([[1.0]]),), dt(0.02))
    assert z[0, 0] == pytest.approx(3.0 - 2.0 * np.exp(-0.02 / 0.05))
    (once,) = law.advance(THETA, x, (z,), dt(0.01))
    (half,) = law.advance(THETA, x, law.advance(THETA, x, (z,), dt(0.004)), dt(0.006))
    assert_allclose(once, half, rtol=1e-15)


def test_in_fine_steps_it_is_the_differential_equation():
    law, z, h = FilmLag(), np.array([[0.0]]), 1e-5
    time = h * np.arange(5000)
    slow = np.zeros(1)
    for t in time:
        w = 4 * np.sin(30 * t)
        (z,) = law.advance(THETA, at(w), (z,), dt(h))
        slow = slow + h * (np.abs(w) - slow) / 0.05
    assert_allclose(z[0], slow, rtol=1e-3)


def test_friction_is_higher_while_the_speed_grows_than_while_it_falls():
    law, z, torque = FilmLag(), np.array([[0.5]]), {}
    ramp = np.linspace(0.5, 4.0, 200)
    for way, speeds in (("up", ramp), ("down", ramp[::-1])):
        series = []
        for w in speeds:
            (z,) = law.advance(THETA, at(w), (z,), dt(5e-4))
            series.append(law.torque(THETA, at(w), (z,))[0, 0])
        torque[way] = np.array(series if way == "up" else series[::-1])
    assert (torque["up"][20:-20] > torque["down"][20:-20] + 1e-3).all()


def test_it_never_drives_whatever_the_film_does():
    rng = np.random.default_rng(0)
    w, z = rng.normal(scale=3.0, size=(500, 2)), rng.exponential(2.0, (500, 2))
    for law, theta in ((FilmLag(), THETA), (FilmLag(symmetric=False), BOTH_WAYS)):
        assert (law.torque(theta, at_rest(w), (z,)) * w >= 0).all()


def test_break_away_is_the_torque_just_above_rest_with_the_film_of_this_moment():
    for law, theta in ((FilmLag(1e-9), THETA), (FilmLag(1e-9, symmetric=False), BOTH_WAYS)):
        z = np.array([[0.3], [1.5], [8.0]])
        for side in (1.0, -1.0):
            level = law.limit(theta, at_rest(side + 0.0 * z), (z,))
            near = side * law.torque(theta, at_rest(side * 1e-6 + 0.0 * z), (z,))
            assert_allclose(level + 0.0 * near, near, rtol=1e-6)


def test_the_longer_a_joint_stands_the_more_holds_it():
    law, z = FilmLag(), (np.array([[3.0]]),)
    levels = [law.limit(THETA, at(1.0), z)[0, 0]]
    for _ in range(200):
        z = law.advance(THETA, at(0.0), z, dt(0.005))
        levels.append(law.limit(THETA, at(1.0), z)[0, 0])
    assert (np.diff(levels) >= 0).all()
    assert levels[0] == pytest.approx(0.1, abs=2e-3) and levels[-1] == pytest.approx(0.16)


def test_a_joint_that_has_just_moved_fast_slips_under_a_load_that_holds_it_later():
    plant = Plant.from_parameters(pendulum(), {"mass": 0.1, "length": 0.2})
    friction = Friction(FilmLag(), THETA)
    u, steps = np.full((60, 1), 0.13), np.full(60, 1 / 60)  # between the levels 0.10 and 0.16
    for film, slips in ((20.0, True), (0.0, False)):
        start = State(np.zeros(1), np.zeros(1), (np.array([film]),))
        motion = rollout(plant, friction, start, u, steps)
        assert (np.abs(motion.q).max() > 1e-3) == slips
        assert motion.w[-1, 0] == 0.0


@pytest.mark.parametrize("lag", [0.01, 0.3])
@pytest.mark.parametrize("velocity", [0.6, 4.0])
def test_truth_in_truth_out(lag, velocity):
    theta = THETA * [1, 1, 0, 1, 0] + [0, 0, velocity, 0, lag]
    assert_recovered(FilmLag(), theta)


def test_truth_in_truth_out_with_two_joints_and_levels_of_each_direction():
    assert_recovered(FilmLag(symmetric=False), BOTH_WAYS, rtol=1e-6, atol=1e-9)


def test_friction_without_memory_has_the_least_lag_there_is():
    problem = explained_by(Stribeck(), THETA[:, :-1])
    found = LeastSquares(FilmLag()).fit(problem, everything(problem), 0)
    assert found.theta[0, 0, 4] == FilmLag().bounds[4][0]
    # along recorded nodes a film sees the mean of both ends: half an interval of lag remains
    assert_allclose(found.theta[0, :, :4], THETA[:, :-1], rtol=0.05)
