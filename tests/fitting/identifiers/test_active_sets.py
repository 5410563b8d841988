"""Active sets: the search finds the best sets, and held-out recordings decide between them."""

from itertools import combinations

import numpy as np
import pytest
from fixtures.exact_problems import everything, explained_by
from numpy.testing import assert_allclose

from frictionid.fitting.identifiers import SINDy, active_sets
from frictionid.fitting.identifiers.active_sets import (
    Constraints,
    admissible,
    best_fits,
    best_proposals,
    best_sets_of_joint,
    held_out_costs,
)
from frictionid.fitting.one_step.grams import clusters, columns, grams
from frictionid.friction.laws import CoulombViscous, Library, Stribeck

LAW = Library()
COULOMB = np.array([[0.10, 0.02], [0.05, 0.01]])
STRIBECK = np.array([[0.10, 0.05, 0.9, 0.02], [0.05, 0.04, 3.2, 0.01]])  # between the grid's ws


def gram_matrices(problem):
    """Gram matrices of one fold as SINDy sees them, and its constraints."""
    fold = next(SINDy()._folds(problem, everything(problem)))
    return fold.G, fold.constraints


def test_the_search_finds_the_best_of_all_sets_of_a_joint():
    problem = explained_by(Stribeck(), STRIBECK, 1e-3)
    G, constraints = gram_matrices(problem)
    T, fixed = G.sum(0), [16, 19]
    sets = best_sets_of_joint(T, constraints, fixed, 0, [])
    assert [len(one.columns) for one in sets] == list(range(2, 2 + len(sets)))
    for one in sets[:4]:
        size = len(one.columns) - 2
        costs = [
            cost_[0]
            for own in combinations(np.flatnonzero(constraints.usable[:16]), size)
            if not (constraints.conflict[np.ix_(own, own)] & ~np.eye(size, dtype=bool)).any()
            for cost_, c in [best_fits(T, np.array([[*own, *fixed]]))]
            if (c > 0).all()
        ]
        assert one.cost == pytest.approx(min(costs), rel=1e-12)


def test_where_sets_are_too_many_they_are_extended_and_exchanged(monkeypatch):
    problem = explained_by(Stribeck(), STRIBECK, 1e-3)
    G, constraints = gram_matrices(problem)
    every = {len(f.columns): f for f in best_sets_of_joint(G.sum(0), constraints, [16, 19], 0, [])}
    monkeypatch.setattr(active_sets, "_LIMIT", 20)
    few = {len(f.columns): f for f in best_sets_of_joint(G.sum(0), constraints, [16, 19], 0, [])}
    assert few[3] == every[3]
    assert few[4].cost < few[3].cost
    assert all(few[size].cost >= every[size].cost * (1 - 1e-9) for size in few if size in every)


def test_held_out_costs_are_those_of_fits_to_the_other_clusters():
    problem = explained_by(CoulombViscous(), COULOMB, 1e-3)
    G, _ = gram_matrices(problem)
    A = columns(LAW, problem)
    label, S = clusters(problem), [0, 3]
    scale = np.sqrt(np.einsum("cii->i", grams(A, everything(problem) / len(A), label)[0]))
    A = A / scale / np.sqrt(len(A))
    losses = held_out_costs(G, S)
    for c in (0, 5, 20):
        rest, out = (A[which].reshape(-1, A.shape[-1]) for which in (label != c, label == c))
        b = np.linalg.lstsq(rest[:, S], rest[:, -1], rcond=None)[0]
        assert losses[c] == pytest.approx(((out[:, -1] - out[:, S] @ b) ** 2).sum(), rel=1e-6)


def test_active_sets_have_one_of_a_family_and_nothing_that_drives():
    rng = np.random.default_rng(0)
    a = rng.standard_normal((50, 4))
    a[:, 3] = a[:, 0] - a[:, 2]
    T = a.T @ a
    alike = np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], dtype=bool)
    constraints = Constraints(
        np.zeros(3, dtype=int), alike, np.ones(3, dtype=bool), np.ones(3, dtype=bool)
    )
    assert admissible(np.array([2.0, 1.0, -1.0]), T, constraints) == (0,)
    assert admissible(np.array([2.0, 1.0, 1.0]), T, constraints) == (
        0,
    )  # the third one would drive
    free = constraints._replace(positive=np.array([True, True, False]))
    assert admissible(np.array([2.0, 1.0, -1.0]), T, free) == (0, 2)
    assert best_sets_of_joint(T, free, [], 0, [(1,)])[-1].columns == (0, 2)
    assert best_proposals(T, free, [(1,), (0, 2)])[-1].columns == (0, 2)
    assert_allclose(best_fits(T, np.array([[0, 2]]))[1][0], [1.0, -1.0], atol=1e-9)


def test_peaks_that_the_motion_does_not_show_are_no_candidates():
    problem = explained_by(CoulombViscous(), COULOMB, 1e-3)
    _, constraints = gram_matrices(problem)
    usable = dict(zip(LAW.names, constraints.usable[:16], strict=True))
    assert usable["peak_3.4"] and not usable["peak_11"]
    fastest = np.abs(problem.nodes.inputs.w[:, 0]).max()
    assert 3.4 < fastest < 1.5 * 11
