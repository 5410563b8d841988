"""Gross outliers of sampled positions: single samples that all others contradict.

The smoother predicts each sample from all others of its series; what that leaves of the sample,
over its standard deviation, is the deletion residual, which shows a single outlier most sharply
[DeJong1989]. A sample is left out where it is `_GATE` times as large as

- usual in its series: the median, which outliers do not enlarge, and
- around it: stick-slip, impacts and reversals are rough for several samples, whereas beside an
  outlier that is left out all samples fit. Where several are left out together, as of a drive that
  chatters, the few that stay fit any motion: then it is more times as large, by their number.

At a kink, an end stop or a rattling gear, the past or the future predicts the sample: it stays.

Outliers hide each other, and disturb the jerk ratio. So candidates are collected first, the largest
of each neighbourhood in each round; those that fit the others after all come back. Where none is
found, the search starts again from a jerk ratio that outliers do not disturb.
"""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array

from .kalman import (
    FilterOutput,
    Series,
    diffuse,
    kalman_filter,
    likeliest_jerk_ratio,
    predicted,
    robust_jerk_ratio,
    smoothed_by,
)

# Upper triangles (a, b, c, d, e, f) of covariances as matrices; signs under reversal of time.
_FULL = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_DIAGONAL = np.array([0, 3, 5])
_TURNED = np.array([1.0, -1.0, 1.0])
_TURNED_SQUARES = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])


def prediction_residuals(
    series: Series, left_out: Array, fit: FilterOutput
) -> list[tuple[Array, Array]]:
    """Measured minus predicted positions (T, S), and the standard deviations of each.

    Predicted by all other samples (deletion residuals), by those before, and by those behind,
    without the ones that are left out (T, S). In units of the value, and of the usual standard
    deviation of a measurement.

    With the predictions x, P by the samples before and y, Q by those behind, all others predict

        x + P (P + Q)^-1 (y - x)    with covariance    P - P (P + Q)^-1 P

    fit : of the series without the samples that are left out
    """
    kept = series.without(left_out)
    x, P = _by_the_past(kept, fit)
    rows, back = _reversed(kept, series.valid.sum(axis=0))
    y, Q = _by_the_past(back, kalman_filter(back, fit.rho))
    y = np.take_along_axis(y, rows[None], axis=1) * _TURNED[:, None, None]
    Q = np.take_along_axis(Q, rows[None], axis=1) * _TURNED_SQUARES[:, None, None]
    scale = np.sqrt((P + Q)[_DIAGONAL])  # (3, T, S)
    total = np.moveaxis((P + Q)[_FULL] / (scale[:, None] * scale), (0, 1), (-2, -1))
    variances = np.moveaxis(P[:3] / scale, 0, -1)
    share = np.linalg.solve(total, variances[..., None])[..., 0]
    middle = x[0] + (share * np.moveaxis((y - x) / scale, 0, -1)).sum(axis=-1)
    variance = np.maximum(P[0] - (share * variances).sum(axis=-1), 0.0)
    predictions = (middle, variance), (x[0], P[0]), (y[0], Q[0])
    return [(series.value - mean, np.sqrt(var + series.noise)) for mean, var in predictions]


def _by_the_past(series: Series, fit: FilterOutput) -> tuple[Array, Array]:
    """Means (3, T, S) and covariances (6, T, S) of the state by the samples before each one."""
    x, P = np.zeros((3, *series.value.shape)), np.zeros((6, *series.value.shape))
    x[0, 0] = series.value[0]
    dt = series.dt[min(1, len(series.dt) - 1)]
    P[0, 0], P[3, 0], P[5, 0] = diffuse(dt)
    before = tuple(fit.mean.T[:, :-1]), tuple(fit.covariance.T[:, :-1])
    x[:, 1:], P[:, 1:] = predicted(*before, series.dt[1:], fit.rho)
    return x, P


def _reversed(series: Series, length: Array) -> tuple[Array, Series]:
    """Rows (T, S) of the samples from last to first, and the series in this order.

    length : (S,) number of samples; behind the end rows stay
    """
    at = np.arange(len(series.dt))[:, None]
    inside = at < length
    rows = np.where(inside, length - 1 - at, at)
    value, noise, valid = (np.take_along_axis(x, rows, axis=0) for x in series[1:4])
    later = np.minimum(rows + 1, len(rows) - 1)
    dt = np.where(inside, np.take_along_axis(series.dt, later, axis=0), series.dt)
    return rows, Series(dt, value, noise, valid, ())


_GATE, _CANDIDATE = 6.0, 4.0
_KINK = 0.25  # of the deletion residual, within which the past or the future predicts a sample
_NEIGHBOURS = 5  # samples to either side
_QUANTILE = 0.75  # of the residuals around a sample
_EXACT = 1e-7  # of the span of a series: what is off by less does not matter
_ROUNDS = 10
_SHARE = 0.6  # of the largest residual of a neighbourhood: candidates
_MANY = 0.003  # of the samples: fewer that change leave the jerk ratio as it is
_DECEIVED = 10.0  # times the jerk ratio: a robust one shows outliers
_AT_ONCE = 400_000  # samples that are smoothed together
_MANY_STEPS = 10  # of an encoder, that show how large one is


class Smoothed(NamedTuple):
    """Smoothed series.

    Attributes
    ----------
    mean : array, shape (T, S, 3), position, velocity and acceleration
    rho : array, shape (S,), jerk ratios
    left_out : array of bool, shape (T, S), gross outliers, which have no influence
    """

    mean: Array
    rho: Array
    left_out: Array


def smoothed(series: Series) -> Smoothed:
    """Series smoothed at their likeliest jerk ratios, without gross outliers.

    >>> from frictionid.data.kalman import even_series
    >>> time = np.arange(100) * 0.01
    >>> value = np.sin(5 * time) + 1e-3 * np.random.default_rng(0).standard_normal(100)
    >>> value[40] += 0.1
    >>> found = smoothed(even_series(value[:, None], 0.01))
    >>> np.flatnonzero(found.left_out), bool(abs(found.mean[40, 0, 0] - np.sin(2.0)) < 2e-3)
    (array([40]), True)
    """
    width, count = max(1, _AT_ONCE // len(series.value)), series.value.shape[1]
    if count <= width:
        return _smoothed(series)
    parts = [_smoothed(series.picked(slice(a, a + width))) for a in range(0, count, width)]
    mean, rho, left_out = zip(*parts, strict=True)
    return Smoothed(np.hstack(mean), np.hstack(rho), np.hstack(left_out))


def _smoothed(series: Series) -> Smoothed:
    """Smoothed series, all of them in memory together."""
    left_out = np.zeros(series.valid.shape, dtype=bool)
    rho = likeliest_jerk_ratio(series)
    fit = kalman_filter(series, rho)
    judged = _judged(series, left_out, fit)
    rough = np.asarray((judged.size > _GATE).any(axis=0))
    if rough.any():
        first = rho[rough]
        left_out[:, rough] = _outliers(series.picked(rough), judged.picked(rough), first, first)
    left_out |= _hidden(series, rho, np.asarray(left_out.any(axis=0)))
    changed = np.asarray(left_out.any(axis=0))
    if changed.any():
        series = series.without(left_out)
        rho[changed] = likeliest_jerk_ratio(series.picked(changed))
        fit = kalman_filter(series, rho)
    return Smoothed(smoothed_by(series, fit), rho, left_out)


def _hidden(series: Series, rho: Array, cleared: Array) -> Array:
    """Outliers (T, S) that pass for rough measurements at jerk ratios rho (S,).

    Of series without outliers that were found before (S,).
    """
    out, robust = np.zeros(series.valid.shape, dtype=bool), _robust(series, rho, ~cleared)
    deceived = robust > _DECEIVED * rho
    if deceived.any():
        searched, ratio = series.picked(deceived), robust[deceived]
        fit = kalman_filter(searched, ratio)
        judged = _judged(searched, out[:, deceived], fit)
        out[:, deceived] = _outliers(searched, judged, ratio, rho[deceived])
    return out


def _robust(series: Series, rho: Array, searched: Array) -> Array:
    """Jerk ratios (S,), those of some series robust ones that are no smaller."""
    out = rho.copy()
    if searched.any():
        out[searched] = robust_jerk_ratio(series.picked(searched), rho[searched])
    return out


class _Judged(NamedTuple):
    """Sizes (T, S) of deletion residuals, in standard deviations as usual in their series.

    kink : (T, S), whether the samples before, or those behind, predict the sample, and well enough
        to show an outlier: then it stands beside a kink of the motion
    """

    size: Array
    kink: Array

    def picked(self, which: Array) -> "_Judged":
        """What was judged of some series."""
        return _Judged(self.size[:, which].copy(), self.kink[:, which].copy())


def _outliers(series: Series, judged: _Judged, rho: Array, least: Array) -> Array:
    """Gross outliers (T, S) of series that were judged as they are, at jerk ratios rho (S,).

    least : (S,), the likeliest jerk ratios with all samples
    """
    candidates, rho = np.zeros(series.valid.shape, dtype=bool), rho.copy()
    for _ in range(_ROUNDS):
        around = _around(np.where(candidates, np.nan, judged.size))
        largest = judged.size >= _SHARE * np.nan_to_num(np.fmax.reduce(around, axis=0))
        new = (judged.size > _CANDIDATE) & (candidates | largest)
        changes = (new != candidates).sum(axis=0)
        if not changes.any():
            break
        candidates, kept = new, series.without(new)
        many, changed = changes > _MANY * series.valid.sum(axis=0), changes > 0
        before = rho.copy()
        if many.any():  # outliers only make it smaller
            rho[many] = np.maximum(likeliest_jerk_ratio(kept.picked(many)), least[many])
        _judge_again(judged, series, new, rho, changed)
        denied = changed & new.any(axis=0) & ~(new & (judged.size > _CANDIDATE)).any(axis=0)
        # by a jerk ratio that explains everything without any noise
        robust = _robust(kept, before, denied)
        denied &= robust > _DECEIVED * before
        rho[denied] = robust[denied]
        _judge_again(judged, series, new, rho, denied)
    beside = np.nansum(_around(candidates.astype(float)), axis=0)
    gate = _GATE * np.maximum(beside - 1.0, 1.0)
    usual = _roughness(np.where(candidates, np.nan, judged.size))
    return candidates & (judged.size > gate * usual) & ~judged.kink


def _judge_again(
    judged: _Judged, series: Series, left_out: Array, rho: Array, which: Array
) -> None:
    """Judge some series anew, without the samples that are left out (T, S)."""
    if not which.any():
        return
    kept = series.without(left_out).picked(which)
    fit = kalman_filter(kept, rho[which])
    again = _judged(series.picked(which), left_out[:, which], fit)
    judged.size[:, which], judged.kink[:, which] = again


def _roughness(size: Array) -> Array:
    """Upper quartile of the sizes (T, S) around each sample, at least 1; NaN do not count."""
    around = np.sort(_around(size), axis=0)  # NaN last
    count = np.isfinite(around).sum(axis=0)
    place = np.maximum(np.ceil(_QUANTILE * count).astype(int) - 1, 0)
    quartile = np.take_along_axis(around, place[None], axis=0)[0]
    return np.where(count > 0, np.fmax(quartile, 1.0), 1.0)


def _around(size: Array) -> Array:
    """Sizes of the samples before and behind each one, (2 * _NEIGHBOURS, T, S), NaN at the ends."""
    T, N = len(size), _NEIGHBOURS
    padded = np.pad(size, ((N, N), (0, 0)), constant_values=np.nan)
    return np.stack([padded[k : k + T] for k in range(2 * N + 1) if k != N])


def _judged(series: Series, left_out: Array, fit: FilterOutput) -> _Judged:
    """All samples (T, S), judged by those that are not left out.

    Samples that repeat both their neighbours, at rest within one step of an encoder, say nothing
    about the usual size, which is that of rounding to those steps at least.
    """
    (off, deviation), *sides = prediction_residuals(series, left_out, fit)
    size = np.where(series.valid, np.abs(off) / deviation, 0.0)
    jumps = np.abs(np.diff(series.value, axis=0))
    change = jumps != 0.0
    fresh = np.ones(series.valid.shape, dtype=bool)
    fresh[1:-1] = change[1:] | change[:-1]
    counts = series.valid & ~left_out
    usual = MAD * _median(size, counts & fresh)
    value = np.where(counts, series.value, np.nan)
    span = np.nan_to_num(np.fmax.reduce(value) - np.fmin.reduce(value))
    steps = np.where(change & series.valid[1:] & series.valid[:-1], jumps, np.inf)
    usual = np.maximum(usual, np.maximum(_EXACT * span + 1e-300, _rounding(steps)))
    # whether the past or the future predicts a sample, where it would show an outlier
    least = np.abs(off)
    kinks = [(np.abs(side) < _KINK * least) & (usual * dev < least) for side, dev in sides]
    return _Judged(size / usual, kinks[0] | kinks[1])


def _rounding(jumps: Array) -> Array:
    """Standard deviations (S,) of rounding to the least jump, where many (T, S) are as small."""
    least = jumps.min(axis=0, initial=np.inf)
    alike = (jumps < 1.5 * least).sum(axis=0)
    return np.where((alike >= _MANY_STEPS) & np.isfinite(least), least / np.sqrt(12.0), 0.0)


def _median(size: Array, counts: Array) -> Array:
    """Medians (S,) of those of (T, S) that count, infinite where none does."""
    ordered = np.sort(np.where(counts, size, np.inf), axis=0)
    return np.take_along_axis(ordered, counts.sum(axis=0)[None] // 2, axis=0)[0]
