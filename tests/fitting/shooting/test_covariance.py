"""Covariance between recordings: intervals of a linear problem are as sure as they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import stdtrit

from frictionid.fitting.shooting.gauss_newton import Solution
from frictionid.fitting.shooting.sandwich import expected, sandwich, scatter, shown_once
from frictionid.fitting.shooting.windows import NormalEquations

SETS, RECORDINGS, WINDOWS, ROWS = 400, 8, 6, 12
TRUE = np.array([1.0, -0.5, 0.2])


def solved(rng, disturbed, shown=slice(None)):
    """Least squares on rows of recordings, each with a disturbance of its own: solution, labels.

    shown : recordings that the last parameter shows in
    """
    D, W = len(TRUE), RECORDINGS * WINDOWS
    labels = np.repeat(np.arange(RECORDINGS), WINDOWS)
    A = rng.standard_normal((W, ROWS, D)) * rng.uniform(0.5, 2.0, (RECORDINGS, 1, 1))[labels]
    A[~np.isin(labels, np.arange(RECORDINGS)[shown]), :, -1] = 0.0
    common = disturbed * rng.standard_normal((RECORDINGS, D))
    y = A @ TRUE + np.einsum("wrd,wd->wr", A, common[labels]) + rng.standard_normal((W, ROWS))
    return of_rows(A, y), labels


def of_rows(A, y):
    """Solution of least squares on rows A (W, R, D) of windows, with right sides y (W, R)."""
    H, g = np.einsum("wri,wrj->wij", A, A), np.einsum("wri,wr->wi", A, y)
    move = np.linalg.solve(H.sum(axis=0), g.sum(axis=0))
    nothing = np.zeros(0)
    normal = NormalEquations(H, g, nothing, nothing, nothing)
    return Solution(
        *(None, nothing, nothing, nothing, nothing, nothing, nothing),
        *(
            normal,
            move,
            np.ones(A.shape[-1], dtype=bool),
            np.ones(len(A)),
            np.zeros(len(A), dtype=bool),
        ),
    )


@pytest.mark.parametrize("disturbed", [0.0, 0.3])
def test_intervals_hold_the_truth_as_often_as_they_say(disturbed):
    rng = np.random.default_rng(7)
    held = []
    for _ in range(SETS):
        solution, labels = solved(rng, disturbed)
        H = solution.normal.H.sum(axis=0)
        error = np.sqrt(np.diag(scatter(H, solution, labels)))
        half = stdtrit(RECORDINGS - 1, 0.975) * error
        held.append(np.abs(solution.move - TRUE) <= half)
    assert 0.92 < np.mean(held) < 0.98  # of 1200 cases


@pytest.mark.parametrize("recordings", [5, 8, 20])
def test_intervals_hold_where_few_recordings_tell_most(recordings):
    """A quarter of the recordings tells some parameter a hundred times as much as the others."""
    rng, held = np.random.default_rng(1), []
    for _ in range(SETS):
        labels = np.repeat(np.arange(recordings), 4)
        size = rng.choice([0.3, 3.0], (recordings, 1, len(TRUE)))
        A = rng.standard_normal((len(labels), ROWS, len(TRUE))) * size[labels]
        solution = of_rows(A, A @ TRUE + rng.standard_normal(A.shape[:2]))
        inner = sandwich(solution.normal.H.sum(axis=0), solution, labels, labels)
        half = stdtrit(recordings - 1, 0.975) * np.sqrt(np.diag(inner))
        held.append(np.abs(solution.move - TRUE) <= half)
    assert 0.92 < np.mean(held) < 0.98


@pytest.mark.parametrize("largest", [1.0, 1.5, 2.0])
def test_the_variance_is_that_of_the_noise_on_average(largest):
    """However unequal the recordings: what tells much is not counted twice."""
    rng, ratio, freedom = np.random.default_rng(3), [], []
    for _ in range(200):
        labels = np.repeat(np.arange(RECORDINGS), 4)
        size = rng.choice([1.0, largest], (RECORDINGS, 1, len(TRUE)))
        A = rng.standard_normal((len(labels), ROWS, len(TRUE))) * size[labels]
        solution = of_rows(A, A @ TRUE + rng.standard_normal(A.shape[:2]))
        H = solution.normal.H.sum(axis=0)
        excess, own = expected(H, solution, labels)
        noise = np.diag(np.linalg.inv(H))
        ratio.append(np.diag(scatter(H, solution, labels)) / excess / noise)
        freedom.append(own)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.06)  # 600 cases
    assert np.all(np.array(freedom) <= RECORDINGS - 1)


def test_without_disturbance_the_scatter_is_that_of_the_noise():
    rng = np.random.default_rng(8)
    ratio = []
    for _ in range(100):
        solution, labels = solved(rng, 0.0)
        H = solution.normal.H.sum(axis=0)
        ratio.append(np.diag(scatter(H, solution, labels)) / np.diag(np.linalg.inv(H)))
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.25)  # the jackknife errs on the large side


def test_a_parameter_of_one_recording_has_no_interval_and_spoils_no_other():
    rng = np.random.default_rng(9)
    ratio = []
    for _ in range(100):
        solution, labels = solved(rng, 0.0, shown=slice(0, 1))
        H = solution.normal.H.sum(axis=0)
        once = shown_once(H, solution, labels)
        assert once.tolist() == [False, False, True]
        rest = scatter(H, solution._replace(free=~once), labels)
        ratio.append(np.diag(rest) / np.diag(np.linalg.inv(H))[:2])
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.25)
