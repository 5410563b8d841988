"""Long recordings: the same numbers stretch by stretch, and little more memory for more rows."""

import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from frictionid.fitting.identifiers import LeastSquares, least_squares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem
from frictionid.fitting.one_step import linearised
from frictionid.fitting.one_step.linearised import Linearised
from frictionid.friction.laws import CoulombViscous, LuGre, Stribeck


@pytest.mark.parametrize("law", [Stribeck(), CoulombViscous(), LuGre()], ids=repr)
@pytest.mark.parametrize("joints", [1, 2])
def test_stretches_change_no_number(law, joints, monkeypatch):
    problem = synthetic_problem(joints)
    weights = np.random.default_rng(0).uniform(0, 1, (3, len(problem.r)))
    fit = Linearised.within(law, problem, weights, ({}, {}, ()))
    theta = np.random.default_rng(1).uniform(0.1, 1.0, (3, joints * len(law.names)))
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
    weights = np.random.default_rng(0).uniform(0.5, 1, (3, len(problem.r)))
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
    for times in (25, 50):
        problem = short.of_rows(np.tile(np.arange(len(short.r)), times))
        weights = np.ones((1, len(problem.r)))
        tracemalloc.start()
        LeastSquares(Stribeck()).fit(problem, weights, seed=0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        rows.append(len(problem.r))
    assert (peaks[1] - peaks[0]) / (rows[1] - rows[0]) < 600  # bytes per row; once 3,800
