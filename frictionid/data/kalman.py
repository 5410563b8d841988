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

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.signals import Signal, relative_noise

# Initial variances of position, velocity and acceleration, in units of the measurement variance:
# practically unknown.
_DIFFUSE = (1e6, 1e14, 1e18)
_FIXED = 3  # samples that determine the state; their innovations do not depend on the noise
_FLOOR = 1e-24  # of the variance: the resolution of stored numbers


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

    def without(self, left_out: Array) -> Series:
        """The series without some samples, by a mask (T, S)."""
        return self._replace(valid=self.valid & ~left_out)

    def of(self, which: Array) -> Series:
        """Some of the series; they belong to no recording."""
        dt, value, noise, valid = (x[:, which] for x in self[:4])
        return Series(dt, value, noise, valid, ())


class FilterOutput(NamedTuple):
    """Output of the Kalman filter; batch axes of the jerk ratio stand before S.

    Attributes
    ----------
    mean : array, shape (T, ..., S, 3)
    covariance : array, shape (T, 6, ..., S), upper triangles
    gain : array, shape (T, 3, ..., S)
    innovation, variance : array, shape (T, ..., S): measured minus predicted position, its variance
    """

    mean: Array
    covariance: Array
    gain: Array
    innovation: Array
    variance: Array


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
        own = slice(at, at + n)
        dt[1:T, own] = np.diff(a.time)[:, None]
        value[:T, own], valid[:T, own] = a.value, True
        noise[:T, own] = relative_noise(a) ** 2
        columns.append(own)
        at += n
    return Series(dt, value, noise, valid, tuple(columns))


def kalman_filter(series: Series, rho: Array) -> FilterOutput:
    """Kalman filter of all series at jerk ratios rho (..., S)."""
    T, shape = len(series.dt), np.broadcast_shapes(np.shape(rho), series.value.shape[1:])
    mean, gain = np.empty((T, 3, *shape)), np.empty((T, 3, *shape))
    covariance, variance = np.empty((T, 6, *shape)), np.empty((T, *shape))
    innovation = np.empty((T, *shape))
    x, P = initial_state(np.broadcast_to(series.value[0], shape))
    for t in range(T):
        if t:
            x, P = predict(x, P, series.dt[t], rho)
        e, s = series.value[t] - x[0], P[0] + series.noise[t]
        K = np.where(series.valid[t], P[:3] / s, 0)
        x = x + K * e
        P = _update(P, K, s / series.noise[t])
        mean[t], covariance[t], gain[t], innovation[t], variance[t] = x, P, K, e, s
    return FilterOutput(np.moveaxis(mean, 1, -1), covariance, gain, innovation, variance)


def initial_state(value: Array) -> tuple[Array, Array]:
    """Mean (3, ...) and covariance (6, ...) before the first sample, next to unknown."""
    x, P = np.zeros((3, *value.shape)), np.zeros((6, *value.shape))
    x[0] = value
    P[0], P[3], P[5] = _DIFFUSE
    return x, P


def predict(x: Array, P: Array, dt: Array, rho: Array) -> tuple[Array, Array]:
    """Mean F x and covariance F P F' + Q one sample later."""
    half = dt * dt / 2
    a, b, c, d, e, f = P
    x = np.array([x[0] + dt * x[1] + half * x[2], x[1] + dt * x[2], x[2]])
    # F P by rows, of which the last two need fewer columns, then times F'
    r0, r1, r2 = a + dt * b + half * c, b + dt * d + half * e, c + dt * e + half * f
    s1, s2 = d + dt * e, e + dt * f
    moved = (r0 + dt * r1 + half * r2, r1 + dt * r2, r2, s1 + dt * s2, s2, f)
    d3 = dt * dt * dt
    noise = (d3 * dt * dt / 20, d3 * dt / 8, d3 / 6, d3 / 3, dt * dt / 2, dt)
    return x, np.array([m + rho * n for m, n in zip(moved, noise, strict=True)])


def _update(P: Array, K: Array, ratio: Array) -> Array:
    """Covariance P - K s K' after a measurement, with ratio = s / (measurement variance).

    The entries of the position are P / ratio: that form cannot cancel.
    """
    a, b, c, d, e, f = P
    measured, kept = K[0] > 0, 1.0 - K[0]
    return np.array(
        [
            np.where(measured, a / ratio, a),
            np.where(measured, b / ratio, b * kept),
            np.where(measured, c / ratio, c * kept),
            d - K[1] * b,
            e - K[1] * c,
            f - K[2] * c,
        ]
    )


def rts_smoother(series: Series, rho: Array) -> Array:
    """Smoothed states (T, S, 3) at jerk ratios rho (S,)."""
    return smoothed_by(series, kalman_filter(series, rho))


def smoothed_by(series: Series, forward: FilterOutput) -> Array:
    """Smoothed states (T, S, 3) from the output of the filter.

    Backward over the samples, with the adjoint l (modified Bryson-Frazier):

        smoothed = mean - P l,    l <- F' (l - H' (K' l + innovation / variance))
    """
    adjoint = np.zeros((3, series.value.shape[1]))
    out = np.empty_like(forward.mean)
    for t in range(len(series.dt) - 1, -1, -1):
        a, b, c, d, e, f = forward.covariance[t]
        x, y, z = adjoint
        correction = (a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z)
        out[t] = forward.mean[t] - np.array(correction).T
        K, dt = forward.gain[t], series.dt[t]
        scaled = np.where(series.valid[t], forward.innovation[t] / forward.variance[t], 0.0)
        x = x - (K[0] * x + K[1] * y + K[2] * z) - scaled
        adjoint = np.array([x, y + dt * x, z + dt * y + dt * dt / 2 * x])
    return out


def likeliest_jerk_ratio(series: Series, decades: tuple[float, float] = (2.0, 20.0)) -> Array:
    """Jerk ratio of each series, shape (S,), that maximises the innovation likelihood.

    Searched on a grid of its logarithm, then on a finer one. The unit is rad^2/s^5 over rad^2: 10^2
    is a slow motion under heavy noise, 10^20 is practically noise-free.
    """
    grid = np.linspace(*decades, 13)
    best = grid[np.argmax(innovation_likelihood(series, 10.0 ** grid[:, None]), axis=0)]
    step = grid[1] - grid[0]
    near = best + np.linspace(-step, step, 13)[:, None]
    score = innovation_likelihood(series, 10.0**near)
    return 10.0 ** np.take_along_axis(near, np.argmax(score, axis=0)[None], axis=0)[0]


def innovation_likelihood(series: Series, rho: Array) -> Array:
    """Log-likelihood of the innovations at jerk ratios rho (..., S), shape of rho.

    The measurement variance is concentrated out, that is, replaced by its likeliest value.
    """
    f = kalman_filter(series, np.broadcast_to(rho, (*rho.shape[:-1], series.value.shape[1])))
    use = series.valid[_FIXED:, None] if rho.ndim > 1 else series.valid[_FIXED:]
    innovation, variance = f.innovation[_FIXED:], f.variance[_FIXED:]
    squares = np.where(use, innovation**2 / variance, 0.0).sum(0)
    logs = np.where(use, np.log(variance), 0.0).sum(0)
    return _log_likelihood(np.maximum(use.sum(0), 1), squares, logs)


def causal_states(series: Series, decades: tuple[float, float] = (2.0, 20.0)) -> Array:
    """Filtered states (T, S, 3), each at the jerk ratio that its past samples make likeliest."""
    rho = 10.0 ** np.linspace(*decades, 19)[:, None]
    f = kalman_filter(series, np.broadcast_to(rho, (len(rho), series.value.shape[1])))
    use = series.valid.copy()
    use[:_FIXED] = False
    use = use[:, None]
    count = np.maximum(np.cumsum(use, axis=0), 1)
    squares = np.cumsum(np.where(use, f.innovation**2 / f.variance, 0.0), axis=0)
    logs = np.cumsum(np.where(use, np.log(f.variance), 0.0), axis=0)
    best = np.argmax(_log_likelihood(count, squares, logs), axis=1)[:, None, :, None]
    return np.take_along_axis(f.mean, best, axis=1)[:, 0]


def _log_likelihood(count: Array, squares: Array, logs: Array) -> Array:
    """Gaussian log-likelihood of `count` innovations at their likeliest variance."""
    return -0.5 * (count * np.log(np.maximum(squares / count, _FLOOR)) + logs)
