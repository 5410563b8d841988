"""Recordings that a fit explains worse than the others: disturbed, or of another machine."""

from __future__ import annotations

from collections.abc import Sequence
from math import lgamma

import numpy as np
from scipy.special import stdtr  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.fitting.shooting.gauss_newton import Solution
from frictionid.fitting.shooting.problem import ShootingProblem
from frictionid.friction.provenance import OddRecording

_WILD = 20.0  # [noise]: residuals count as so large at most
_FEW = 5  # recordings: among fewer none can be told from the others
_CLEAR = 0.01  # p-value, times the choices of recordings
_WORTH = 1.5  # times the usual size of the residuals: what is worth a word
_MOST = 4  # one recording in so many may be odd


def odd_recordings(problem: ShootingProblem, solution: Solution) -> tuple[OddRecording, ...]:
    """The recordings that are not explained as the others are, largest residuals first.

    Without windows that are left out as their predictions jump.
    """
    smooth = ~solution.kinked
    owner = problem.intervals.recording[solution.windows[smooth, 0]]
    rows = np.unique(owner)
    residual = np.minimum(np.abs(solution.residual[smooth]) / solution.sigma, _WILD)
    share = solution.share[smooth, :, None] * np.ones_like(residual)
    sizes = np.array(
        [
            np.sqrt((residual[windows] ** 2 * share[windows]).sum() / share[windows].sum())
            for windows in (owner == row for row in rows)
        ]
    )
    names = [problem.intervals.dataset.recordings[int(row)].name for row in rows]
    return odd_among(sizes, names)


def odd_among(sizes: Array, names: Sequence[str]) -> tuple[OddRecording, ...]:
    """Those of R sizes that stand off from the rest, by the generalised test of [Rosner1983].

    The k largest are odd where the smallest of them stands off from the mean of the R - k others:

        t = (x_k - mean) / (s (1 + 1/(R - k))^1/2),    x = log(size),    with R - k - 1 freedoms

    for the largest such k, with p-values times the number of choices of k recordings.
    """
    count, order = len(sizes), np.argsort(-sizes)
    x = np.log(np.maximum(sizes[order], 1e-300))
    for k in range(count // _MOST if count >= _FEW else 0, 0, -1):
        rest = x[k:]
        scale = max(float(rest.std(ddof=1)), 1e-9) * np.sqrt(1.0 + 1.0 / len(rest))
        off = (x[:k] - rest.mean()) / scale
        tail = np.maximum(stdtr(len(rest) - 1, -off), 1e-300)
        p = np.exp(np.minimum(0.0, np.log(tail) + _log_choices(count, k)))
        usual = float(np.exp(rest.mean()))
        if p[k - 1] < _CLEAR and sizes[order[k - 1]] > _WORTH * usual:
            return tuple(
                OddRecording(names[i], float(sizes[i]), usual, float(p_value))
                for i, p_value in zip(order[:k], p, strict=True)
            )
    return ()


def _log_choices(count: int, k: int) -> float:
    """Logarithm of the number of choices of k out of so many: of thousands it is no float.

    >>> round(np.exp(_log_choices(5, 2)))
    10
    """
    return lgamma(count + 1) - lgamma(k + 1) - lgamma(count - k + 1)


def odd_sentences(odd: Sequence[OddRecording]) -> tuple[str, ...]:
    """What is odd, for people."""
    return tuple(
        f"Recording {recording.recording!r} is not explained as the others are: its angles "
        f"are off by {recording.size:.2g} times the noise, theirs by {recording.usual:.2g} (p = "
        f"{recording.p_value:.1g}). "
        "Was it disturbed, or did it have another load? Leave it out, or give it that load."
        for recording in odd
    )
