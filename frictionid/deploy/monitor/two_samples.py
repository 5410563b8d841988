"""Whether two groups of recordings differ: a permutation test, and Hotelling's test.

A recording is a row of numbers for each joint. The permutation test asks how often a random choice
of as many recordings among all of them lies as far from the others as the new ones do. Where
healthy recordings are exchangeable, its rate of false alarms is at most what is asked for, whatever
their distribution [Phipson2010], [WestfallYoung1993]. Hotelling's test needs fewer recordings and
a normal distribution [Hotelling1931].
"""

from __future__ import annotations

from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

MOST_CHOICES = 5_000  # all of them up to here, else so many at random


class Difference(NamedTuple):
    """How far new recordings lie from those of the baseline, of n joints.

    p : probability of this or more in one of the joints, if nothing has changed
    p_of_joint : (n,) the same of each joint, corrected for their number
    distance : (n,) squared distance of each joint, in units of the scatter between recordings
    choices : number of choices that were compared; p is at least one over it
    """

    p: float
    p_of_joint: Array
    distance: Array
    choices: int


def least_rate(healthy: int, new: int) -> float:
    """Smallest rate of false alarms that a permutation test can promise.

    >>> least_rate(99, 1), round(least_rate(20, 5), 6)
    (0.01, 0.0002)
    """
    return 1.0 / min(comb(healthy + new, new), MOST_CHOICES)


def needed_recordings(rate: float, new: int) -> int:
    """Healthy recordings that are needed to promise a rate of false alarms for some new ones.

    >>> needed_recordings(0.01, 1), needed_recordings(0.01, 5)
    (99, 4)
    """
    healthy = 1
    while least_rate(healthy, new) > rate * (1 + 1e-9):
        healthy += 1
    return healthy


def permutation_test(healthy: Array, new: Array, seed: int = 0) -> Difference:
    """Difference of new recordings (k, n, d) from healthy ones (N, n, d) by permutation.

    The distance of a joint is Mahalanobis', with the covariance of all N + k recordings, which
    no permutation changes; its correlations are shrunk where recordings are few.

    >>> rng = np.random.default_rng(0)
    >>> found = permutation_test(rng.normal(size=(99, 2, 3)), rng.normal(size=(1, 2, 3)) + 9.0)
    >>> found.p, found.choices
    (0.01, 100)
    """
    rows = np.concatenate([healthy, new])
    count, k = len(rows), len(new)
    white = white_rows(rows)
    chosen = _choices(count, k, seed)
    means = white[chosen].mean(axis=1)  # (B, n, d), those of the new ones first
    distance = k * count / (count - k) * (means**2).sum(axis=-1)
    # rounding must not tell equal choices apart
    as_far = distance.max(axis=1)[:, None] >= distance[0] * (1 - 1e-9)
    p_of_joint = as_far.mean(axis=0)
    return Difference(float(p_of_joint.min()), p_of_joint, distance[0], len(chosen))


def white_rows(rows: Array) -> Array:
    """Rows (N, n, d) about their mean, each joint in units of its own shrunk covariance."""
    return np.stack([_white(rows[:, j]) for j in range(rows.shape[1])], axis=1)


def _white(rows: Array) -> Array:
    """Rows (N, d) about their mean, in units of their shrunk covariance.

    Correlations of d columns shrink by d/N: as many rows as columns tell nothing of them.
    """
    size = rows.std(axis=0)
    centred = (rows - rows.mean(axis=0)) / np.where(size > 0, size, 1.0)
    count, d = rows.shape
    shrinkage = min(1.0, d / count)
    covariance = (1.0 - shrinkage) * (centred.T @ centred / count) + shrinkage * np.eye(d)
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), centred.T).T)


def _choices(count: int, k: int, seed: int) -> Array:
    """Choices (B, k) of k among `count` rows; the last k rows, the new ones, come first."""
    own = np.arange(count - k, count)
    if comb(count, k) <= MOST_CHOICES:
        every = np.array(list(combinations(range(count), k)))
        return np.concatenate([every[-1:], every[:-1]])  # the last combination is that of the last
    rng = np.random.default_rng(seed)
    drawn = rng.random((MOST_CHOICES - 1, count)).argpartition(k, axis=1)[:, :k]
    return np.concatenate([own[None], drawn])


def hotelling_test(healthy: Array, new: Array) -> Difference:
    """Difference by Hotelling's T^2 with the scatter of the healthy recordings alone.

    Shapes as of `permutation_test`; p of the joints are corrected by Bonferroni. The rate holds
    where recordings scatter normally, the new ones as the healthy ones. NaN where the healthy
    recordings are no more than d + 1.
    """
    from scipy.stats import f

    (N, n, d), k = healthy.shape, len(new)
    free = N - 1
    if free <= d:
        nothing = np.full(n, np.nan)
        return Difference(np.nan, nothing, nothing, 0)
    distance = np.empty(n)
    for j in range(n):
        off = new[:, j].mean(axis=0) - healthy[:, j].mean(axis=0)
        scatter = np.atleast_2d(np.cov(healthy[:, j].T))
        distance[j] = N * k / (N + k) * off @ np.linalg.pinv(scatter) @ off
    p = f.sf((free - d + 1) / (free * d) * distance, d, free - d + 1)
    corrected = np.minimum(1.0, n * p)
    return Difference(float(corrected.min()), corrected, distance, 0)
