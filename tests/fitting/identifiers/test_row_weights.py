"""Weights of rows in a least-squares fit, and fits that see through wrong rows."""

from dataclasses import replace

import numpy as np
import pytest
from fixtures.exact_problems import everything, explained_by, standard_errors
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.one_step.residual import huber_factors
from frictionid.friction import along
from frictionid.friction.laws import CoulombViscous, Stribeck

STRIBECK = np.array([[0.10, 0.04, 1.5, 0.02], [0.05, 0.03, 2.5, 0.01]])


def fit(law, problem, weights, **settings):
    return LeastSquares(law, **settings).fit(problem, weights, 0)


def test_rows_that_count_twice_are_rows_that_stand_there_twice():
    problem = explained_by(Stribeck(), STRIBECK, 1e-3, 1)
    doubled = problem.of_rows(np.concatenate([np.arange(120), np.arange(40)]))
    weights = np.where(np.arange(120) < 40, 2.0, 1.0)[None]
    one, two = (
        fit(Stribeck(), *pair) for pair in ((problem, weights), (doubled, np.ones((1, 160))))
    )
    assert_allclose(one.theta, two.theta, rtol=1e-8)


@pytest.mark.parametrize("size", [1e-300, 1e307])
def test_the_size_of_weights_does_not_matter(size):
    problem = synthetic_problem(2)
    weights = synthetic_weights(problem)
    usual, other = (fit(Stribeck(), problem, w) for w in (weights, size * weights))
    assert_allclose(other.theta, usual.theta, rtol=1e-6)


def test_one_row_that_weighs_enormously_is_met_exactly():
    problem = explained_by(CoulombViscous(), STRIBECK[:, [0, 3]], 1e-2, 2)
    weights = everything(problem)
    weights[0, 17] = 1e16
    found = fit(CoulombViscous(), problem, weights)
    off = np.abs(problem.residual(along(found, problem.nodes)))[0]
    assert off[17].max() < 1e-6 < np.median(off)


@pytest.mark.parametrize(
    ("weights", "complaint"),
    [
        (np.ones(120), r"weights must have shape \(folds, 120\), got \(120,\)"),
        (np.ones((2, 119)), r"weights must have shape \(folds, 120\), got \(2, 119\)"),
        (np.full((1, 120), np.nan), "weights must be finite and not negative"),
        (np.full((1, 120), np.inf), "weights must be finite and not negative"),
        (-np.ones((1, 120)), "weights must be finite and not negative"),
        (np.eye(2, 120)[::-1] * [[0.0], [1.0]], "fold 0 has no rows to fit"),
    ],
)
def test_weights_that_mean_nothing_are_refused(weights, complaint):
    with assert_refused(complaint):
        fit(CoulombViscous(), synthetic_problem(1), weights)


def spoilt(problem, rng, share=0.05, size=1.0):
    """The problem with large errors in some of its rows."""
    hit = rng.uniform(size=len(problem.r)) < share
    return replace(problem, r=problem.r + size * hit[:, None] * rng.normal(size=problem.r.shape))


def test_a_robust_fit_sees_through_rows_that_are_wrong():
    rng, noise = np.random.default_rng(5), 1e-3
    problem = explained_by(Stribeck(), STRIBECK, noise, rng)
    error = standard_errors(Stribeck(), STRIBECK, problem, noise)
    wrong = spoilt(problem, rng)
    plain, robust = (
        fit(Stribeck(), wrong, everything(problem), robust=clip, neutral=False).theta[0]
        for clip in (None, 3.0)
    )
    assert (np.abs(robust - STRIBECK) < 4 * error).all()
    assert (np.abs(plain - STRIBECK) > 8 * error).any()


def test_a_robust_fit_of_good_rows_is_nearly_the_plain_one():
    rng, noise = np.random.default_rng(6), 1e-3
    problem = explained_by(Stribeck(), STRIBECK, noise, rng)
    error = standard_errors(Stribeck(), STRIBECK, problem, noise)
    plain, robust = (
        fit(Stribeck(), problem, everything(problem), robust=clip).theta[0] for clip in (None, 3.0)
    )
    assert (np.abs(robust - plain) < 0.5 * error).all()
    same = fit(Stribeck(), problem, everything(problem), robust=1e9).theta[0]
    assert_allclose(same, plain, rtol=1e-6)


def test_rows_keep_a_share_by_their_worst_joint_in_weighted_standard_deviations():
    residual = np.random.default_rng(7).normal(size=(2, 4000, 2)) * [1.0, 5.0]
    kept = huber_factors(residual, np.ones((2, 4000)), clip=3.0)
    worst = np.max(np.abs(residual) / [1.0, 5.0], axis=-1)
    assert_allclose(kept, np.minimum(1.0, 3.0 / worst), rtol=0.05)
    rows = np.repeat(np.arange(50), 3)
    one, three = residual[:1, :50], residual[:1, rows]
    weighted = huber_factors(one, np.full((1, 50), 3.0), 1.0)
    assert_allclose(weighted[:, rows], huber_factors(three, np.ones((1, 150)), 1.0))
    unseen = np.where(np.arange(50) < 40, 1.0, 0.0)[None]
    assert_array_equal(
        huber_factors(one, unseen, 1.0)[:, :40], huber_factors(one[:, :40], unseen[:, :40], 1.0)
    )


def test_joints_that_rest_most_of_the_time_do_not_shrink_the_deviation():
    residual = np.random.default_rng(8).normal(size=(1, 100, 1))
    still = np.concatenate([residual, np.zeros((1, 400, 1))], axis=1)
    kept = huber_factors(still, np.ones((1, 500)), 2.0)
    assert_array_equal(kept[:, :100], huber_factors(residual, np.ones((1, 100)), 2.0))
    assert_array_equal(kept[:, 100:], 1.0)


@pytest.mark.parametrize("clip", [0.0, -1.0, float("nan")])
def test_a_robust_fit_needs_a_positive_number_of_deviations(clip):
    with assert_refused("robust: it should be"):
        LeastSquares(Stribeck(), robust=clip)
