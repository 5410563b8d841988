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

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import compiled, inlined

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
    return FilterOutput(rho, *filtered(*_by_series(series), rho))


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
    return np.moveaxis(smoothed(dt, valid, *states, innovation / variance), 0, 1)


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
    whole, _ = likelihoods(*_by_series(series), ratios, False)
    return np.asarray(whole)


def robust_jerk_ratio(series: Series, least: Array) -> Array:
    """Jerk ratio (S,) that is likeliest by the median of the innovations, at least `least` (S,).

    Beside outliers everything passes for rough, so that the likeliest ratio is too small; this one
    is not deceived while most innovations are free of them.
    """
    low = np.log10(least)
    steps = np.arange(0.0, np.max(20.0 - low, initial=0.0) + 1.5, 1.5)
    ratios = 10.0 ** np.minimum(low + steps[:, None], np.maximum(low, 20.0))
    score, _ = likelihoods(*_by_series(series), ratios, True)
    return np.asarray(np.take_along_axis(ratios, np.argmax(score, axis=0)[None], axis=0)[0])


def causal_states(series: Series) -> Array:
    """Filtered states (T, S, 3), each at the jerk ratio that its past samples make likeliest."""
    slowest, out = _slowest(series), np.empty((*series.value.shape, 3))
    for low in np.unique(slowest):
        rows = slowest == low
        grid = 10.0 ** np.arange(low, 20.1)
        rho = np.repeat(grid[:, None], rows.sum(), axis=1)
        _, means = likelihoods(*_by_series(series.picked(rows)), rho, False)
        out[:, rows] = means.swapaxes(0, 1)
    return out


# --- Loops over the samples -----------------------------------------------------------------------
# Each sample depends on the one before, so that arrays of NumPy cannot hold the loop. Series are
# (S, T): samples of one series stand side by side. G jerk ratios of each are tried at once. Slices
# that are set, and medians of NumPy, would take seconds to compile.

_FIXED = 3  # samples that determine the state; their innovations do not depend on the noise
_FLOOR = 1e-24  # of the variance: the resolution of stored numbers


def predicted(mean: Any, covariance: Any, dt: Any, rho: Any) -> Any:
    """Mean F x and covariance F P F' + Q one sample later: tuples of numbers, or of arrays."""
    x, v, w = mean
    a, b, c, d, e, f = covariance
    half = dt * dt / 2
    # F P by rows, of which the last two need fewer columns, then times F'
    r0, r1, r2 = a + dt * b + half * c, b + dt * d + half * e, c + dt * e + half * f
    s1, s2 = d + dt * e, e + dt * f
    d3 = dt * dt * dt
    return (x + dt * v + half * w, v + dt * w, w), (
        r0 + dt * r1 + half * r2 + rho * (d3 * dt * dt / 20),
        r1 + dt * r2 + rho * (d3 * dt / 8),
        r2 + rho * (d3 / 6),
        s1 + dt * s2 + rho * (d3 / 3),
        s2 + rho * (dt * dt / 2),
        f + rho * dt,
    )


def diffuse(dt: Any) -> tuple[Any, Any, Any]:
    """Initial variances of position, velocity and acceleration: practically unknown.

    In units of the measurement variance. Over first intervals dt beyond 0.1 s smaller ones are as
    unknown; rounding errors of larger ones would outlast the samples that follow.
    """
    slower = np.maximum(10.0 * dt, 1.0)
    return 1e6, 1e14 / slower**2, 1e18 / slower**4


_predicted, _diffuse = inlined(predicted), inlined(diffuse)


@inlined
def _initial(value: float, dt: float) -> Any:
    """Mean and covariance before the first sample, next to unknown."""
    a, d, f = _diffuse(dt)
    return (value, 0.0, 0.0), (a, 0.0, 0.0, d, 0.0, f)


@inlined
def _updated(mean: Any, covariance: Any, innovation: float, variance: float, noise: float) -> Any:
    """Mean, covariance and gain after a measurement.

    The entries of the position are P / ratio: that form cannot cancel.
    """
    x, v, w = mean
    a, b, c, d, e, f = covariance
    k0, k1, k2 = a / variance, b / variance, c / variance
    ratio = variance / noise
    less = (a / ratio, b / ratio, c / ratio, d - k1 * b, e - k1 * c, f - k2 * c)
    return (x + k0 * innovation, v + k1 * innovation, w + k2 * innovation), less, (k0, k1, k2)


@compiled
def filtered(dt: Array, value: Array, noise: Array, valid: Array, rho: Array) -> Any:
    """Output of the filter at jerk ratios (S,), see `FilterOutput`."""
    S, T = dt.shape
    means, covariances, gains = np.empty((S, T, 3)), np.empty((S, T, 6)), np.zeros((S, T, 3))
    innovations, variances = np.empty((S, T)), np.empty((S, T))
    for s in range(S):
        x, P = _initial(value[s, 0], dt[s, min(1, T - 1)])
        for t in range(T):
            if t:
                x, P = _predicted(x, P, dt[s, t], rho[s])
            innovation, variance = value[s, t] - x[0], P[0] + noise[s, t]
            if valid[s, t]:
                x, P, gain = _updated(x, P, innovation, variance, noise[s, t])
                for i in range(3):
                    gains[s, t, i] = gain[i]
            for i in range(3):
                means[s, t, i] = x[i]
            for i in range(6):
                covariances[s, t, i] = P[i]
            innovations[s, t], variances[s, t] = innovation, variance
    return means, covariances, gains, innovations, variances


@compiled
def likelihoods(
    dt: Array, value: Array, noise: Array, valid: Array, rho: Array, robust: bool
) -> Any:
    """Log-likelihoods (G, S) of the innovations at jerk ratios (G, S), and the likeliest means.

    Means (S, T, 3) are at the jerk ratio of each series that its samples so far make likeliest.
    The measurement variance is concentrated out, that is, replaced by its likeliest value; in the
    `robust` log-likelihoods by that of the median innovation, which a few that are far off change
    little.
    """
    G, S, T = len(rho), len(dt), dt.shape[1]
    size = np.empty(T)
    whole, means, best = np.empty((G, S)), np.empty((S, T, 3)), np.full((S, T), -np.inf)
    for g, s in np.ndindex(G, S):
        x, P = _initial(value[s, 0], dt[s, min(1, T - 1)])
        count, squares, logs, likelihood = 0, 0.0, 0.0, 0.0
        for t in range(T):
            if t:
                x, P = _predicted(x, P, dt[s, t], rho[g, s])
            if valid[s, t]:
                innovation, variance = value[s, t] - x[0], P[0] + noise[s, t]
                x, P, _ = _updated(x, P, innovation, variance, noise[s, t])
                if t >= _FIXED:
                    if robust:
                        size[count] = abs(innovation) / math.sqrt(variance)
                    count += 1
                    squares += innovation * innovation / variance
                    logs += math.log(variance)
                    usual = max(squares / count, _FLOOR)
                    likelihood = -0.5 * (count * math.log(usual) + logs)
            if likelihood > best[s, t]:
                best[s, t] = likelihood
                for i in range(3):
                    means[s, t, i] = x[i]
        if robust and count:
            usual = max(np.median(size[:count]) ** 2, _FLOOR)
            likelihood = -0.5 * (count * math.log(usual) + logs)
        whole[g, s] = likelihood
    return whole, means


@compiled
def smoothed(
    dt: Array, valid: Array, means: Array, covariances: Array, gains: Array, scaled: Array
) -> Any:
    """Smoothed means (S, T, 3) from the filter's output at one jerk ratio.

    scaled : innovations over their variances
    """
    S, T = dt.shape
    out = np.empty((S, T, 3))
    for s in range(S):
        x, y, z = 0.0, 0.0, 0.0
        for t in range(T - 1, -1, -1):
            a, b, c, d, e, f = covariances[s, t]
            k, h = gains[s, t], dt[s, t]
            out[s, t, 0] = means[s, t, 0] - (a * x + b * y + c * z)
            out[s, t, 1] = means[s, t, 1] - (b * x + d * y + e * z)
            out[s, t, 2] = means[s, t, 2] - (c * x + e * y + f * z)
            x = x - (k[0] * x + k[1] * y + k[2] * z) - (scaled[s, t] if valid[s, t] else 0.0)
            x, y, z = x, y + h * x, z + h * y + h * h / 2 * x
    return out
