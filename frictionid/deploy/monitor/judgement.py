"""Whether two groups of recordings differ: a permutation test, and Hotelling's test.

A recording is a row of numbers for each joint. The permutation test asks how often a random choice
of as many recordings among all of them lies as far from the others as the new ones do. Where
healthy recordings are exchangeable, its rate of false alarms is at most what is asked for, whatever
their distribution [Phipson2010], [WestfallYoung1993]. Hotelling's test needs fewer recordings and
a normal distribution [Hotelling1931].
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice
from math import ceil, comb
from typing import Literal, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.monitor.baseline import Baseline
from frictionid.deploy.monitor.changes import PARTS, Changes, curve_changes

CHOICES = 5_000  # all of them up to here, else so many at random
MOST_CHOICES = 10_000_000  # where a small rate needs more than these, a minute's work


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

    >>> least_rate(99, 1), round(1 / least_rate(20, 5))
    (0.01, 53130)
    """
    return 1.0 / min(comb(healthy + new, new), MOST_CHOICES)


def needed_recordings(rate: float, new: int) -> int:
    """Healthy recordings N that promise a rate for k new ones: the least of C(N + k, k) >= 1/rate.

    >>> needed_recordings(0.01, 1), needed_recordings(0.01, 5), needed_recordings(1e-9, 1)
    (99, 4, 999999999)
    """
    choices = (1.0 - 1e-12) / max(rate, 1e-300)
    low, high = 0, 1  # too few, enough
    while comb(high + new, new) < choices:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if comb(middle + new, new) >= choices else (middle, high)
    return high


def permutation_test(
    healthy: Array, new: Array, seed: int = 0, rate: float = 1.0 / CHOICES
) -> Difference:
    """Difference of new recordings (k, n, d) from healthy ones (N, n, d) by permutation.

    The distance of a joint is Mahalanobis', with the covariance of all N + k recordings, which
    no permutation changes; its correlations are shrunk where recordings are few. As many choices
    are compared as a `rate` of false alarms needs, at most `MOST_CHOICES`.

    >>> rng = np.random.default_rng(0)
    >>> found = permutation_test(rng.normal(size=(99, 2, 3)), rng.normal(size=(1, 2, 3)) + 9.0)
    >>> found.p, found.choices
    (0.01, 100)
    """
    rows = np.concatenate([healthy, new])
    count, k = len(rows), len(new)
    white = white_rows(rows)
    most = min(max(CHOICES, ceil((1.0 - 1e-12) / rate)), MOST_CHOICES)

    def distances(chosen: Array) -> Array:
        means = white[chosen].mean(axis=1)  # (B, n, d)
        return np.asarray(k * count / (count - k) * (means**2).sum(axis=-1))

    distance = distances(np.arange(count - k, count)[None])[0]
    as_far, choices = np.zeros(rows.shape[1]), 0
    for chosen in _choices(count, k, most, seed):
        # rounding must not tell equal choices apart
        as_far += (distances(chosen).max(axis=1)[:, None] >= distance * (1 - 1e-9)).sum(axis=0)
        choices += len(chosen)
    p_of_joint = as_far / choices
    return Difference(float(p_of_joint.min()), p_of_joint, distance, choices)


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


def _choices(count: int, k: int, most: int, seed: int) -> Iterator[Array]:
    """All choices (B, k) of k among `count` rows or, where they are too many, `most` of them.

    They come in blocks, that of the last k rows, the new ones, among them.
    """
    if comb(count, k) <= most:
        every = combinations(range(count), k)
        while block := list(islice(every, CHOICES)):
            yield np.array(block)
        return
    rng = np.random.default_rng(seed)
    yield np.arange(count - k, count)[None]
    for first in range(1, most, CHOICES):
        size = min(CHOICES, most - first)
        yield rng.random((size, count)).argpartition(k, axis=1)[:, :k]


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


Test = Literal["permutation", "normal"]
Answer = Literal["changed", "unchanged", "cannot_tell"]
_OTHERWISE = 0.9985  # one-sided share of healthy choices whose mean speed differs less
_LONGER = 1.5  # times the longest healthy recording, whose changes scatter less


class PartChange(NamedTuple):
    """Change of one part of a joint's friction with its 95 % interval [N m], and in per cent.

    joint : from 0; part : "coulomb", "viscous", "stribeck", "asymmetry", or "total"
    per_cent : of the reference friction at the usual speed
    """

    joint: int
    part: str
    value: float
    low: float
    high: float
    per_cent: float


class Judgement(NamedTuple):
    """What new recordings say.

    answer : "changed", "unchanged" or "cannot_tell"
    rate : of false alarms that was asked for; promised : the least that these recordings allow
    test : how the rate follows
    p, p_of_joint : see `Difference`
    joints : those that changed, from 0
    parts : of all joints
    notes : sentences on what limits the judgement
    """

    answer: Answer
    rate: float
    promised: float
    test: Test
    p: float
    p_of_joint: Array
    joints: tuple[int, ...]
    parts: tuple[PartChange, ...]
    notes: tuple[str, ...]


def judge(
    baseline: Baseline, new: Changes, rate: float = 0.01, test: Test = "permutation"
) -> Judgement:
    """Judgement on new recordings (k) against the healthy ones (N) of a baseline.

    Linear effects of covariates, such as a temperature, are removed from both first. Changes of
    recordings that are shorter than the healthy ones scatter more: no rate holds for their alarms.
    """
    before, after = without_covariates(baseline.changes, new)
    speeds, asked = baseline.reference.speeds, rate * (1 + 1e-9)
    groups = curve_changes(before, speeds), curve_changes(after, speeds)
    if test == "normal":
        difference, promised = hotelling_test(*groups), 0.0
    else:
        promised = least_rate(*map(len, groups))
        # where they cannot promise the rate, more choices say nothing
        difference = permutation_test(*groups, rate=rate if promised <= asked else 1.0)
    changed = tuple(int(j) for j in np.flatnonzero(difference.p_of_joint <= asked))
    shorter = new.seconds.min() * _LONGER < baseline.changes.seconds.min()
    able = np.isfinite(difference.p) and promised <= asked and not (changed and shorter)
    answer: Answer = "cannot_tell" if not able else "changed" if changed else "unchanged"
    return Judgement(
        answer,
        rate,
        promised,
        test,
        difference.p,
        difference.p_of_joint,
        changed if able else (),
        tuple(_parts(baseline, before, after)),
        tuple(_notes(baseline, new, difference, rate, promised, test)),
    )


def without_covariates(healthy: Changes, new: Changes) -> tuple[Array, Array]:
    """Parts (N, n, 4) and (k, n, 4) without what is linear in the covariates of all recordings.

    A covariate that is the same in all healthy ones stays: it would take any change with it.
    """
    parts = np.concatenate([healthy.parts, new.parts])
    beside = np.concatenate([healthy.covariates, new.covariates])
    differs = np.ptp(healthy.covariates, axis=0) > 0
    usable = np.isfinite(beside).all(axis=0) & differs if beside.size else []
    if not np.any(usable):
        return healthy.parts, new.parts
    x = beside[:, usable] - beside[:, usable].mean(axis=0)
    flat = parts.reshape(len(parts), -1)
    slope, *_ = np.linalg.lstsq(x, flat - flat.mean(axis=0), rcond=None)
    left = (flat - x @ slope).reshape(parts.shape)
    return left[: len(healthy.parts)], left[len(healthy.parts) :]


def _parts(baseline: Baseline, healthy: Array, new: Array) -> list[PartChange]:
    """Change of each part of each joint, its interval from the scatter between recordings."""
    from scipy.stats import t

    N, k = len(healthy), len(new)
    reach = float(t.ppf(0.975, N - 1)) * np.sqrt(1 / N + 1 / k)
    rows = []
    for j in range(len(baseline.joints)):
        columns = {part: (healthy[:, j, i], new[:, j, i]) for i, part in enumerate(PARTS)}
        columns["total"] = tuple(group[:, j, :2].sum(axis=1) for group in (healthy, new))
        for part, (before, after) in columns.items():
            off = float(after.mean() - before.mean())
            half = reach * float(before.std(ddof=1))
            per_cent = 100.0 * off / float(baseline.level[j])
            rows.append(PartChange(j, part, off, off - half, off + half, per_cent))
    return rows


def _other_speed(healthy: Array, new: Array) -> Array:
    """1 for joints (n,) that are faster on average than healthy ones (N, n) scatter, -1 slower."""
    from scipy.stats import t

    N, k = len(healthy), len(new)
    if N < 2:
        return np.zeros(healthy.shape[1])
    scatter = healthy.std(axis=0, ddof=1) * np.sqrt(1 / N + 1 / k)
    off = new.mean(axis=0) - healthy.mean(axis=0)
    return np.sign(off) * (np.abs(off) > float(t.ppf(_OTHERWISE, N - 1)) * scatter)


def _notes(
    baseline: Baseline,
    new: Changes,
    difference: Difference,
    rate: float,
    promised: float,
    test: Test,
) -> list[str]:
    """What limits the judgement."""
    N, k = len(baseline.names), len(new.parts)
    out = []
    if test == "permutation" and promised > rate * (1 + 1e-9):
        out.append(
            f"{N} healthy and {k} new recordings allow no rate of false alarms below "
            f"{promised:.2g}; {rate:g} needs {needed_recordings(rate, k)} healthy ones"
            + f", and no rate is below {1 / MOST_CHOICES:g}"
            * (rate * MOST_CHOICES < 1)
        )
    if test == "normal":
        out.append(
            "the rate assumes that changes scatter normally between recordings"
            if np.isfinite(difference.p)
            else f"{N} healthy recordings are too few for the normal distribution: "
            f"{len(PARTS) + 2} are needed"
        )
    for j, side in enumerate(_other_speed(baseline.changes.speeds, new.speeds)):
        if side:
            usual, mean = baseline.changes.speeds[:, j], new.speeds[:, j].mean()
            how, cause = ("faster", "less") if side > 0 else ("slower", "more")
            out.append(
                f"{baseline.joints[j]} moves {how} than in the baseline ({mean:.3g} against "
                f"{usual.min():.3g} to {usual.max():.3g}), as {cause} friction makes it, or other "
                "motion, for which the rate of false alarms does not hold"
            )
    length, healthy = new.seconds, baseline.changes.seconds
    if length.max() > _LONGER * healthy.max() or length.min() * _LONGER < healthy.min():
        out.append(
            f"recordings of {length.min():.3g} to {length.max():.3g} s are not exchangeable with "
            f"healthy ones of {healthy.min():.3g} to {healthy.max():.3g} s: take parts as long as "
            "those"
        )
    for i, name in enumerate(baseline.covariates):
        low, high = (f(baseline.changes.covariates[:, i]) for f in (np.min, np.max))
        mean = float(new.covariates[:, i].mean())
        if not low <= mean <= high:
            out.append(
                f"{name} = {mean:.4g} lies outside the baseline's {low:.4g} to {high:.4g}: "
                "a change of friction may be its effect"
            )
    return out
