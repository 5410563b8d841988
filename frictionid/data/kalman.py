"""Kalman filter and RTS smoother of positions whose jerk is white noise, many series at once.

State (position, velocity, acceleration); over dt the transition and process noise covariance are

    F = [1 dt dt^2/2]        Q = rho [dt^5/20 dt^4/8 dt^3/6]
        [0  1 dt    ]                [dt^4/8  dt^3/3 dt^2/2]
        [0  0  1    ]                [dt^3/6  dt^2/2 dt    ]

rho is the jerk intensity over the measurement variance, so that the usual measurement variance
is one. The smoother is the modified Bryson-Frazier form, which needs no inverse [Bierman1973].

Arrays have the axes T (samples) and S (series: one for each recording and joint). Covariances are
stored by their upper triangle P = [a b c; b d e; c e f] as (a, b, c, d, e, f).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data import kalman_loops

from .signals import Signal, relative_noise

_ALIKE = 1.5  # times as long as the shortest of a group, at most


class Series(NamedTuple):
    """Positions of all recordings and joints side by side.

    Attributes
    ----------
    dt : array, shape (T, S) [s], to the sample before
    value : array, shape (T, S)
    noise : array, shape (T, S), variance of each sample relative to the usual one of its series
    valid : array of bool, shape (T, S), false behind the end of shorter recordings, and for
        samples that are left out
    columns : slices of the S series, one for each recording
    """

    dt: Array
    value: Array
    noise: Array
    valid: Array
    columns: tuple[slice, ...]

    def without(self, left_out: Array) -> "Series":
        """The series without some samples, by a mask (T, S)."""
        return self._replace(valid=self.valid & ~left_out)

    def picked(self, which: Array | slice) -> "Series":
        """Some of the series; they belong to no recording."""
        dt, value, noise, valid = (x[:, which] for x in self[:4])
        return Series(dt, value, noise, valid, ())


class FilterOutput(NamedTuple):
    """Output of the Kalman filter, series by series as the loops have it.

    Attributes
    ----------
    rho : array, shape (S,), jerk ratios
    mean : array, shape (S, T, 3)
    covariance : array, shape (S, T, 6), upper triangles
    gain : array, shape (S, T, 3)
    innovation, variance : array, shape (S, T): measured minus predicted position, its variance
    """

    rho: Array
    mean: Array
    covariance: Array
    gain: Array
    innovation: Array
    variance: Array


def alike(angles: Sequence[Signal]) -> list[list[int]]:
    """Numbers of signals in groups of about one length, so that `padded_series` pads little.

    >>> alike([Signal(np.arange(float(T)), np.zeros((T, 1))) for T in (9, 2, 3, 8)])
    [[1, 2], [0, 3]]
    """
    groups: list[list[int]] = []
    for i in sorted(range(len(angles)), key=lambda i: len(angles[i].time)):
        if not groups or len(angles[i].time) > _ALIKE * len(angles[groups[-1][0]].time):
            groups.append([])
        groups[-1].append(i)
    return [sorted(group) for group in groups]


def by_length(
    angles: Sequence[Signal], estimate: Callable[[Series], tuple[Array, ...]]
) -> list[tuple[Array, ...]]:
    """What is estimated of each signal (T, n) beside those of about its length.

    estimate : from a series to arrays (T, S, ...) of its samples, or (S,)
    """
    parts: dict[int, tuple[Array, ...]] = {}
    for group in alike(angles):
        series = padded_series([angles[i] for i in group])
        whole = estimate(series)
        for i, columns in zip(group, series.columns, strict=True):
            T = len(angles[i].time)
            parts[i] = tuple(x[columns] if x.ndim == 1 else x[:T, columns] for x in whole)
    return [parts[i] for i in range(len(angles))]


def even_series(value: Array, dt: float) -> Series:
    """Series (T, S) sampled every dt [s] with the same noise in all samples."""
    shape = value.shape
    return Series(np.full(shape, dt), value, np.ones(shape), np.ones(shape, dtype=bool), ())


def padded_series(angles: Sequence[Signal]) -> Series:
    """Series of all recordings and joints; shorter ones are padded at the end.

    >>> short = Signal(np.array([0.0, 0.1]), np.zeros((2, 2)))
    >>> long = Signal(np.array([0.0, 0.1, 0.2]), np.ones((3, 2)))
    >>> padded_series([short, long]).valid[2].tolist()
    [False, False, True, True]
    """
    length = max(len(a.time) for a in angles)
    width = sum(a.value.shape[1] for a in angles)
    dt, value = np.full((length, width), 0.01), np.zeros((length, width))
    noise, valid = np.ones((length, width)), np.zeros((length, width), dtype=bool)
    columns, at = [], 0
    for a in angles:
        T, n = a.value.shape
        joints = slice(at, at + n)
        dt[1:T, joints] = np.diff(a.time)[:, None]
        value[:T, joints], valid[:T, joints] = a.value, True
        noise[:T, joints] = relative_noise(a) ** 2
        columns.append(joints)
        at += n
    return Series(dt, value, noise, valid, tuple(columns))


def kalman_filter(series: Series, rho: Array) -> FilterOutput:
    """Kalman filter of all series at jerk ratios rho (S,)."""
    return FilterOutput(rho, *kalman_loops.filtered(*_by_series(series), rho))


def _by_series(series: Series) -> tuple[Array, ...]:
    """Interval, value, noise and validity (S, T) of the samples of each series."""
    return tuple(np.ascontiguousarray(x.T) for x in series[:4])


def rts_smoother(series: Series, rho: Array) -> Array:
    """Smoothed states (T, S, 3) at jerk ratios rho (S,)."""
    return smoothed_by(series, kalman_filter(series, rho))


def smoothed_by(series: Series, forward: FilterOutput) -> Array:
    """Smoothed states (T, S, 3) from the output of the filter.

    Backward over the samples, with the adjoint l (modified Bryson-Frazier):

        smoothed = mean - P l,    l <- F' (l - H' (K' l + innovation / variance))
    """
    dt, _, _, valid = _by_series(series)
    _, *states, innovation, variance = forward
    return np.moveaxis(kalman_loops.smoothed(dt, valid, *states, innovation / variance), 0, 1)


def likeliest_jerk_ratio(series: Series) -> Array:
    """Jerk ratio of each series, shape (S,), that maximises the innovation likelihood.

    Searched on a grid of its logarithm, then on a finer one. The unit is rad^2/s^5 over rad^2: 10^2
    is a slow motion under heavy noise, 10^20 is practically noise-free.
    """
    slowest, out = _slowest(series), np.empty(series.value.shape[1])
    for low in np.unique(slowest):
        rows = slowest == low
        out[rows] = _likeliest(series.picked(rows), low)
    return out


def _likeliest(series: Series, slowest: float) -> Array:
    """The likeliest of the jerk ratios from the slowest one on, (S,)."""
    grid = np.arange(slowest, 20.1, 1.5)
    best = grid[np.argmax(innovation_likelihood(series, 10.0 ** grid[:, None]), axis=0)]
    step = grid[1] - grid[0]
    near = best + np.linspace(-step, step, 13)[:, None]
    score = innovation_likelihood(series, 10.0**near)
    return 10.0 ** np.take_along_axis(near, np.argmax(score, axis=0)[None], axis=0)[0]


def _slowest(series: Series) -> Array:
    """Logarithm (S,) of the least jerk ratio of a search: that of slower motion in sparse samples.

    2 where samples are no farther apart than at 30 Hz; motion ten times as slow has 10^-5 of it.
    """
    columns = zip(series.dt[1:].T, series.valid[1:].T, strict=True)
    usual = [np.median(dt[valid]) if valid.any() else 1 / 60 for dt, valid in columns]
    return 2.0 - 3.0 * np.round(np.maximum(0.0, 5.0 * np.log10(60.0 * np.array(usual))) / 3.0)


def innovation_likelihood(series: Series, rho: Array) -> Array:
    """Log-likelihood (G, S) of the innovations at jerk ratios rho, (G, S) or (G, 1).

    The measurement variance is concentrated out, that is, replaced by its likeliest value.
    """
    # repeated: for views that cannot be written loops would be compiled again
    ratios = rho.repeat(series.value.shape[1] // rho.shape[1], axis=1)
    whole, _ = kalman_loops.likelihoods(*_by_series(series), ratios, False)
    return np.asarray(whole)


def robust_jerk_ratio(series: Series, least: Array) -> Array:
    """Jerk ratio (S,) that is likeliest by the median of the innovations, at least `least` (S,).

    Beside outliers everything passes for rough, so that the likeliest ratio is too small; this one
    is not deceived while most innovations are free of them.
    """
    low = np.log10(least)
    steps = np.arange(0.0, np.max(20.0 - low, initial=0.0) + 1.5, 1.5)
    ratios = 10.0 ** np.minimum(low + steps[:, None], np.maximum(low, 20.0))
    score, _ = kalman_loops.likelihoods(*_by_series(series), ratios, True)
    return np.asarray(np.take_along_axis(ratios, np.argmax(score, axis=0)[None], axis=0)[0])


def causal_states(series: Series) -> Array:
    """Filtered states (T, S, 3), each at the jerk ratio that its past samples make likeliest."""
    slowest, out = _slowest(series), np.empty((*series.value.shape, 3))
    for low in np.unique(slowest):
        rows = slowest == low
        grid = 10.0 ** np.arange(low, 20.1)
        rho = np.repeat(grid[:, None], rows.sum(), axis=1)
        _, means = kalman_loops.likelihoods(*_by_series(series.picked(rows)), rho, False)
        out[:, rows] = means.swapaxes(0, 1)
    return out
