"""Least squares of Coulomb, viscous and Stribeck friction; long recordings by stretches."""

import tracemalloc

import numpy as np
import pytest
from fixtures.exact_problems import (
    BY_DIRECTION,
    COULOMB,
    STRIBECK,
    by_scipy,
    cost,
    everything,
    explained_by,
    on_problem,
    stationarity,
    with_initial,
)
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.arrays import times
from frictionid.fitting.identifiers import LeastSquares, least_squares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.one_step import linearised
from frictionid.fitting.one_step.linearised import Linearised
from frictionid.friction.laws import CoulombViscous, LuGre, Stribeck

PLAIN, SYMMETRIC, ASYMMETRIC = CoulombViscous(), Stribeck(), Stribeck(symmetric=False)
TRUTH = {PLAIN: COULOMB, SYMMETRIC: STRIBECK, ASYMMETRIC: BY_DIRECTION}
BOTH = pytest.mark.parametrize("law", [SYMMETRIC, ASYMMETRIC], ids=["symmetric", "asymmetric"])


EACH = pytest.mark.parametrize("law", TRUTH, ids=["plain", "symmetric", "asymmetric"])


def fit(law, problem, weights=None):
    """The plain minimum, also where rows do not tell a parameter."""
    weights = everything(problem) if weights is None else weights
    return LeastSquares(law, robust=None, neutral=False).fit(problem, weights, 0)


@BOTH
@pytest.mark.parametrize("velocity", [0.5, 1.1, 3.0])
def test_truth_in_truth_out(law, velocity):
    theta = TRUTH[law].copy()
    theta[:, law.names.index("stribeck_velocity")] *= velocity
    problem = explained_by(law, theta)
    assert_allclose(fit(law, problem).theta[0], theta, rtol=1e-6, atol=1e-9)


@BOTH
def test_every_start_in_the_valley_leads_to_the_truth(law):
    place = law.names.index("stribeck_velocity")
    near = [start for start in law.initial if 0.25 < start[place] / 1.5 < 3.0]
    assert len(near) >= 5
    problem = explained_by(law, TRUTH[law][:1])
    for start in near:
        found = fit(with_initial(law, start), problem)
        assert_allclose(found.theta[0], TRUTH[law][:1], rtol=1e-6)


@EACH
def test_each_fold_is_scipys_least_squares(law):
    problem = synthetic_problem(2)
    weights = synthetic_weights(problem)
    for f, theta in enumerate(fit(law, problem, weights).theta):
        same = by_scipy(law, problem, weights[f], TRUTH[law])
        assert_allclose(theta, same, rtol=1e-6)


@BOTH
@pytest.mark.parametrize("seed", range(6))
def test_bounds_hold_and_at_them_the_gradient_points_outwards(law, seed):
    rng = default_rng(seed)
    theta = TRUTH[law] * rng.uniform(-0.5, 1.0, TRUTH[law].shape)  # half of it outside the bounds
    theta[:, law.names.index("stribeck_velocity")] = rng.uniform(0.2, 20.0, 2)
    problem = explained_by(law, theta, 1e-3, rng)
    weights = synthetic_weights(problem)
    found = fit(law, problem, weights).theta
    for f in range(len(weights)):
        low, high = (b.reshape(2, -1) for b in on_problem(law, problem, weights[f]).bounds)
        assert ((low <= found[f]) & (found[f] <= high)).all()
        assert (found[f] == low).any()
        off = stationarity(law, problem, weights[f], found[f])
        assert np.abs(off).max() < 2e-6


def test_coulomb_viscous_in_stribeck_in_asymmetric_each_costs_no_more_than_the_last():
    rng = default_rng(9)
    for seed in range(6):
        theta = TRUTH[ASYMMETRIC] * rng.uniform(0.0, 2.0, (2, 6))
        theta[:, 4] = rng.uniform(0.4, 15.0, 2)
        problem = explained_by(ASYMMETRIC, theta, 2e-3, seed)
        weights = synthetic_weights(problem)
        laws = CoulombViscous(), SYMMETRIC, ASYMMETRIC
        costs = [cost(problem, weights, fit(law, problem, weights)) for law in laws]
        assert (costs[1] <= costs[0] * (1 + 1e-9)).all()
        assert (costs[2] <= costs[1] * (1 + 1e-9)).all()
        assert (costs[2] < 0.999 * costs[0]).any()


@pytest.mark.parametrize("shape", ["tanh", "arctan"])
@pytest.mark.parametrize("factor", [10.0, [1.0, 0.0], [0.0, 1.0], 0.0])
def test_levels_of_all_sizes_come_out(shape, factor):
    law, theta = CoulombViscous(width=0.05, shape=shape), TRUTH[PLAIN] * factor
    problem = explained_by(law, theta)
    found = fit(law, problem)
    assert_allclose(found.theta[0], theta, rtol=1e-9, atol=1e-12)


def test_a_level_of_an_arctangent_is_its_level_at_high_speed():
    theta = np.array([[0.1, 0.0]])
    law = CoulombViscous(width=0.01, shape="arctan")
    w = synthetic_problem(1).nodes.inputs.w
    published = 0.1 / (np.pi / 2) * np.arctan(100 * w)  # as others write it: cf = level/(pi/2)
    problem = explained_by(law, theta)
    mean = times(problem.G, problem.mean(published))
    assert_allclose(problem.r, mean, rtol=1e-12)
    assert_allclose(fit(law, problem).theta[0], theta, atol=1e-12)


# --- Long recordings ------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [Stribeck(), CoulombViscous(), LuGre()], ids=repr)
@pytest.mark.parametrize("joints", [1, 2])
def test_stretches_change_no_number(law, joints, monkeypatch):
    problem = synthetic_problem(joints)
    weights = default_rng(0).uniform(0, 1, (3, len(problem.r)))
    fit = Linearised.within(law, problem, weights, ({}, {}, ()))
    theta = default_rng(1).uniform(0.1, 1.0, (3, joints * len(law.names)))
    whole = fit.normal_equations(theta, fit.residual(theta), weights)
    monkeypatch.setattr(linearised, "_ROWS", 37)
    # of a law with memory whole recordings: here three
    assert len(list(fit.stretches())) == (3 if law.has_memory else 4)
    parts = fit.normal_equations(theta, fit.residual(theta), weights)
    for a, b in zip(whole, parts, strict=True):
        assert_allclose(a, b, rtol=1e-11, atol=1e-12 * np.abs(a).max())


@pytest.mark.parametrize("robust", [None, 3.0])
def test_many_rows_are_fitted_as_without_beginning_with_some(robust, monkeypatch):
    problem = synthetic_problem(2, noise=0.03)
    weights = default_rng(0).uniform(0.5, 1, (3, len(problem.r)))
    identifier = LeastSquares(CoulombViscous(), robust=robust)
    whole = identifier.fit(problem, weights, seed=0)
    looks = []
    every = Linearised.every
    monkeypatch.setattr(Linearised, "every", lambda *own: looks.append(own[1]) or every(*own))
    monkeypatch.setattr(least_squares, "_ENOUGH", 40)
    begun = identifier.fit(problem, weights, seed=0)
    assert looks == [3]
    tolerance = 1e-9 if robust is None else 1e-3  # robust weights are found in two rounds
    assert_allclose(begun.theta, whole.theta, rtol=tolerance)


def test_where_some_rows_determine_nothing_all_rows_do(monkeypatch):
    problem = synthetic_problem(1)
    weights = np.zeros((1, len(problem.r)))
    weights[:, 1::3] = 1.0  # none of those that a fit would begin with
    whole = LeastSquares(Stribeck()).fit(problem, weights, seed=0)
    monkeypatch.setattr(least_squares, "_ENOUGH", 40)
    begun = LeastSquares(Stribeck()).fit(problem, weights, seed=0)
    assert_array_equal(begun.theta, whole.theta)


def test_more_rows_need_little_more_memory(monkeypatch):
    monkeypatch.setattr(linearised, "_ROWS", 2_000)
    peaks, rows = [], []
    short = synthetic_problem(1)
    for count in (25, 50):
        problem = short.of_rows(np.tile(np.arange(len(short.r)), count))
        weights = everything(problem)
        tracemalloc.start()
        LeastSquares(Stribeck()).fit(problem, weights, seed=0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        rows.append(len(problem.r))
    assert (peaks[1] - peaks[0]) / (rows[1] - rows[0]) < 600  # bytes per row; once 3,800
