"""Friction curves of any shape."""

import numpy as np
import pytest
from fixtures.exact_problems import explained_by, fit_to_all, splines
from fixtures.mistakes import changes, mistakes
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BSpline

from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import CoulombViscous, Spline
from frictionid.friction.model_files import model_document, read_model

KNOTS = (0.5, 1.0, 2.0, 4.0, 8.0)
DEGREES = pytest.mark.parametrize("degree", [1, 2, 3])


@DEGREES
def test_it_is_the_b_spline_of_scipy_that_begins_level(degree):
    law = Spline(KNOTS, degree)
    theta = splines(law, 1)
    levels = np.cumsum(theta[0])
    t = [0.0] * (degree + 1) + list(KNOTS) + [8.0] * degree
    theirs = BSpline(t, [levels[0], *levels], degree)
    w = np.linspace(0.4, 7.99, 300)
    assert_allclose(Friction(law, theta).curve(w)[:, 0], theirs(w), rtol=1e-12)
    assert theirs(0.0) == pytest.approx(law.limit(theta, at_rest(np.ones(1)), ())[0])


@DEGREES
def test_beyond_the_last_knot_it_goes_on_straight(degree):
    law = Spline(KNOTS, degree)
    curve = Friction(law, splines(law, 1)).curve(np.array([7.999, 8.0, 8.001, 12.0, 16.0]))[:, 0]
    assert (curve[4] - curve[3]) == pytest.approx(curve[3] - curve[1])
    assert (curve[2] - curve[1]) == pytest.approx(curve[1] - curve[0], rel=1e-2)


def test_the_level_grows_with_the_load():
    x = at_rest(np.array([[3.0], [-3.0], [1e-9]]))._replace(load=np.array([[2.0], [5.0], [2.0]]))
    theta = np.append(splines(Spline(), 1)[0], 0.1)[None]
    plain, loaded = (
        Spline(loaded=loads).torque(theta[:, : 6 + loads], x, ()) for loads in (False, True)
    )
    assert_allclose((loaded - plain)[:2, 0], [0.2, -0.5])


def test_level_and_load_together_are_not_negative():
    law, x = Spline((1.0, 2.0), 1, loaded=True), at_rest(np.array([[2.0]]))
    theta = np.array([[0.1, -0.3, 0.05]])
    for load, torque in ((2.0, 0.0), (6.0, 0.1)):
        loaded = x._replace(load=np.array([[load]]))
        assert law.torque(theta, loaded, ()) == pytest.approx(torque)
        slopes = law.gradient(theta, loaded)[0, 0]
        assert (slopes == 0).all() if torque == 0 else slopes[-1] == pytest.approx(load)


def test_a_negative_level_counts_as_zero():
    law = Spline((1.0, 2.0), 1)
    torque = Friction(law, [[0.1, -0.3]]).curve(np.linspace(-4, 4, 101))[:, 0]
    assert torque.max() == pytest.approx(0.1) and (torque[[0, -1]] == 0.0).all()
    assert (torque * np.linspace(-4, 4, 101) >= 0).all()


def test_each_direction_is_a_spline_of_its_own():
    law = Spline(symmetric=False)
    theta, w = splines(law, 1), np.linspace(0.1, 10, 40)
    half = theta.shape[-1] // 2
    both = Friction(law, theta).curve(np.concatenate([-w, w]))
    up, down = (Friction(Spline(), t).curve(w) for t in (theta[:, :half], theta[:, half:]))
    assert_array_equal(both, np.concatenate([-down, up]))


def test_what_the_data_do_not_reach_has_no_rise_and_the_curve_goes_on():
    problem = synthetic_problem(1)
    fastest = np.abs(problem.nodes.inputs.w).max()
    law = Spline((0.5, 1.0, 2.0, 4.0, 6.0, 50.0, 90.0, 200.0), 1)
    found = fit_to_all(LeastSquares(law), problem)[0]
    assert 6.0 < fastest < 50.0
    assert (found.theta[0, -2:] == 0.0).all() and (found.theta[0, 1:-2] != 0.0).all()
    curve = found.curve(np.array([50.0, 150.0, 300.0]))[:, 0]
    assert_allclose(curve, curve[0])


@pytest.mark.parametrize("seed", range(4))
def test_rises_that_the_data_just_touch_stay_at_zero_and_do_not_run_away(seed):
    problem = explained_by(CoulombViscous(), [[0.1, 0.02]], 2e-3, seed)
    speeds = np.abs(problem.nodes.inputs.w[problem.stencil])
    slow = (speeds < 2.2).all(axis=(1, 2))[None] * 1.0  # the knots go on at 2, 4, and 8 rad/s
    found = LeastSquares(Spline(KNOTS)).fit(problem, slow, 0)[0]
    assert (found.theta[0, 4:] == 0.0).all()  # without neutral values -8.6 to 11 N m
    assert found.curve(np.array([6.0]))[0, 0] == pytest.approx(0.16, abs=0.02)


WRONG = r"""
knots = [1.0] => knots: .*at least 2 items
knots = [1.0, "fast"] => knots\[1\]: it should be a valid number
knots = [0.0, 1.0] => knots\[0\]: it should be greater than 0
knots = [1.0, 1.0] => knots = \[1.0, 1.0\] rad/s must increase
degree = 4 => degree: it should be less than or equal to 3, not 4
degree = true => degree: it should be a valid integer, not True
"""


@mistakes(WRONG)
def test_settings_that_mean_nothing_are_refused(wrong, words):
    with assert_refused(words):
        Spline(**changes(wrong))
    document = model_document(Friction(Spline(), splines(Spline(), 1)))
    document["law"] |= changes(wrong)
    with assert_refused(words):
        read_model(document, "model.json")
