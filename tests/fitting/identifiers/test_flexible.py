"""Curves of any shape, linear in their parameters, and the one that a machine is calibrated by."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from fixtures.exact_problems import cost, explained_by, fit_to_all
from fixtures.refusals import assert_refused
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from frictionid.fitting.identifiers import Flexible, LeastSquares
from frictionid.fitting.identifiers.check_identifier import synthetic_problem, synthetic_weights
from frictionid.fitting.one_step.linearised import FEW, clusters, columns, grams
from frictionid.friction import Friction
from frictionid.friction.laws import Spline, Stribeck, Table

KNOTS = (0.5, 1.5, 3.0, 6.0)
LAWS_ = (Spline(KNOTS), Spline(KNOTS, 1), Spline(KNOTS, symmetric=False), Table((0.5, 1.5, 3.0)))


def drawn(law):
    """Parameters of two joints whose level stays above zero."""
    theta = 0.01 * np.random.default_rng(0).normal(size=(2, len(law.names)))
    level = [not name.startswith("rise") for name in law.names]
    return theta + 0.2 * np.array(level)


@pytest.mark.parametrize("law", LAWS_, ids=["spline", "hat basis", "asymmetric", "table"])
def test_it_is_least_squares_by_another_route(law):
    problem = explained_by(Stribeck(), np.array([[0.1, 0.04, 1.5, 0.02]] * 2), 2e-3, 1)
    weights = synthetic_weights(problem)
    ours = LeastSquares(law, robust=None, neutral=False).fit(problem, weights, 0)
    A = columns(law, problem) * np.sqrt(weights)[:, :, None, None]
    low, high = np.tile(law.bounds, (2, 1)).T
    for fold, rows in enumerate(A.reshape(len(A), -1, A.shape[-1])):
        theirs = lsq_linear(rows[:, :-1], rows[:, -1], (low, high), tol=1e-14)
        assert cost(problem, weights, ours)[fold] == pytest.approx(2 * theirs.cost, rel=1e-9)
        assert_allclose(ours.theta[fold].ravel(), theirs.x, atol=1e-6)


def test_a_curve_does_not_drive():
    """A level below zero counts as zero, and then the law is no longer linear."""
    law = Spline((1.0, 4.0), 1)
    problem = explained_by(law, [[0.1, -0.15]])
    found = fit_to_all(LeastSquares(law), problem)
    assert (found[0].curve(np.array([3.0, 5.0]))[:, 0] >= 0).all()


@pytest.mark.parametrize("cells", [3, 2000], ids=["fold by fold", "by sums of rows"])
def test_gram_matrices_add_up_what_the_rows_say(cells, monkeypatch):
    monkeypatch.setattr(import_module("frictionid.fitting.one_step.linearised"), "_CELLS", cells)
    problem = synthetic_problem(2)
    A, label = columns(Spline(KNOTS), problem), clusters(problem)
    folds = (problem.recording != np.arange(3)[:, None]) * [[1.0], [2.0], [0.5]]
    for weights in (folds, synthetic_weights(problem)):
        G = grams(A, weights, label)
        for f, c in ((0, 0), (1, 8), (2, 20)):
            rows = A[label == c]
            direct = np.einsum("k,kia,kib->ab", weights[f, label == c], rows, rows)
            assert_allclose(G[f, c], direct, rtol=1e-10, atol=1e-15)
        assert_allclose(grams(A, weights, 0 * label)[:, 0], G.sum(1), rtol=1e-9, atol=1e-13)


def test_clusters_are_recordings_where_there_are_enough_and_else_stretches():
    problem = synthetic_problem(1)
    label = clusters(problem)
    assert len(np.unique(label)) >= 20
    for c in np.unique(label):
        own = np.flatnonzero(label == c)
        assert len(set(problem.recording[own])) == 1 and (np.diff(own) == 1).all()
    many = replace(problem, recording=np.arange(len(problem.r)) % FEW * 3)
    assert len(np.unique(clusters(many))) == FEW


def test_a_table_is_straight_between_its_speeds_and_level_beyond():
    law = Table((1.0, 2.0, 4.0))
    friction = Friction(law, [[0.3, 0.1, 0.2, 0.5, 0.5, 0.5]])
    w = np.array([0.3, 1.0, 1.5, 2.0, 3.0, 4.0, 40.0])
    assert_allclose(friction.curve(w)[:, 0], [0.3, 0.3, 0.2, 0.1, 0.15, 0.2, 0.2])
    assert_allclose(friction.curve(-w)[:, 0], -0.5)


@pytest.mark.parametrize("speeds", [(1.0,), (0.0, 1.0), (2.0, 1.0), (1.0, "fast")])
def test_speeds_of_a_table_that_mean_nothing_are_refused(speeds):
    with assert_refused("Table: speeds"):
        Table(speeds)


def test_a_joint_that_slides_in_fewer_rows_than_it_has_parameters_has_no_friction():
    problem = synthetic_problem(2)
    G = problem.G.copy()
    G[3:, :, 1] = 0.0
    fit = fit_to_all(LeastSquares(Spline(KNOTS)), replace(problem, G=G))
    assert (fit.theta[0, 0, 0] > 0.0) and (fit.theta[0, 1] == 0.0).all()


def test_the_curve_that_calibrates_is_near_any_and_made_for_the_speeds_of_the_data():
    truth = np.array([[0.1, 0.04, 1.5, 0.02]])
    problem = explained_by(Stribeck(), truth)
    found = fit_to_all(Flexible(), problem)[0]
    fastest = np.abs(problem.nodes.inputs.w).max()
    assert found.law.knots[-1] == pytest.approx(fastest / 2) and found.law.uses_load
    w = np.linspace(0.1, fastest, 200)
    off = found.curve(w) / Friction(Stribeck(), truth).curve(w) - 1
    assert np.abs(off).max() < 0.03
    still = problem.nodes.inputs._replace(w=0.0 * problem.nodes.inputs.w)
    problem = replace(problem, nodes=problem.nodes._replace(inputs=still))
    with assert_refused("no joint moves in a fold"):
        fit_to_all(Flexible(), problem)
