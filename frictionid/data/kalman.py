"""Kalman filter and smoother of a point driven by white jerk, many series side by side.

State (position, velocity, acceleration); over dt the transition and its noise covariance are

    F = [1 dt dt^2/2]        Q = rho [dt^5/20 dt^4/8 dt^3/6]
        [0  1 dt    ]                [dt^4/8  dt^3/3 dt^2/2]
        [0  0  1    ]                [dt^3/6  dt^2/2 dt    ]

with rho the jerk intensity over the measurement variance, so that the usual measurement variance
is one.
The smoother is the modified Bryson-Frazier form, which needs no inverse [Bierman1973].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.signals import Signal, unevenness


class Series(NamedTuple):
    """Angles of recordings and joints as columns: dt (T, S) to the sample before, value (T, S).

    noise (T, S) is the variance of each sample relative to its column's usual one.
    `valid` (T, S) is false behind the end of shorter recordings; `rows` slices the columns of each
    recording.
    """

    dt: Array
    value: Array
    noise: Array
    valid: Array
    rows: tuple[slice, ...]


class Filtered(NamedTuple):
    """Filter output: mean (T, S, 3), covariance (T, 6, S), gain (T, 3, S), innovations (T, S)."""

    mean: Array
    covariance: Array
    gain: Array
    innovation: Array
    variance: Array


def pad(angles: Sequence[Signal]) -> Series:
    """Columns of all recordings and joints, shorter ones padded at the end.

    >>> short = Signal(np.array([0.0, 0.1]), np.zeros((2, 2)))
    >>> long = Signal(np.array([0.0, 0.1, 0.2]), np.ones((3, 2)))
    >>> pad([short, long]).valid[2].tolist()
    [False, False, True, True]
    """
    length = max(len(a.time) for a in angles)
    width = sum(a.value.shape[1] for a in angles)
    dt, value = np.full((length, width), 0.01), np.zeros((length, width))
    noise, valid = np.ones((length, width)), np.zeros((length, width), dtype=bool)
    rows, at = [], 0
    for a in angles:
        T, n = a.value.shape
        own = slice(at, at + n)
        dt[1:T, own] = np.diff(a.time)[:, None]
        value[:T, own], valid[:T, own] = a.value, True
        noise[:T, own] = unevenness(a) ** 2
        rows.append(own)
        at += n
    return Series(dt, value, noise, valid, tuple(rows))


def filtered(series: Series, rho: Array) -> Filtered:
    """Kalman filter of all series at jerk ratios rho (..., S), whose batch axes stand before S."""
    T, shape = len(series.dt), np.broadcast_shapes(np.shape(rho), series.value.shape[1:])
    mean, gain = np.empty((T, 3, *shape)), np.empty((T, 3, *shape))
    covariance, variance = np.empty((T, 6, *shape)), np.empty((T, *shape))
    innovation = np.empty((T, *shape))
    x = np.zeros((3, *shape))
    x[0] = series.value[0]
    # a start that knows nothing of velocity and acceleration, in units of the measurement noise
    P = np.zeros((6, *shape))
    P[0], P[3], P[5] = 1e6, 1e14, 1e18
    for t in range(T):
        if t:
            x, P = _predict(x, P, series.dt[t], rho)
        e, s = series.value[t] - x[0], P[0] + series.noise[t]
        K = np.where(series.valid[t], P[:3] / s, 0)
        x = x + K * e
        P = _update(P, K, s / series.noise[t])
        mean[t], covariance[t], gain[t], innovation[t], variance[t] = x, P, K, e, s
    return Filtered(np.moveaxis(mean, 1, -1), covariance, gain, innovation, variance)


def _predict(x: Array, P: Array, dt: Array, rho: Array) -> tuple[Array, Array]:
    half = dt * dt / 2
    a, b, c, d, e, f = P  # [a b c; b d e; c e f]
    x = np.stack([x[0] + dt * x[1] + half * x[2], x[1] + dt * x[2], x[2]])
    # rows of F P, then times F'
    r0, r1, r2 = a + dt * b + half * c, b + dt * d + half * e, c + dt * e + half * f
    s1, s2 = d + dt * e, e + dt * f
    d3 = dt * dt * dt
    noise = (d3 * dt * dt / 20, d3 * dt / 8, d3 / 6, d3 / 3, dt * dt / 2, dt)
    new = (
        r0 + dt * r1 + half * r2,
        r1 + dt * r2,
        r2,
        s1 + dt * s2,
        s2,
        f,
    )
    return x, np.stack([n + rho * m for n, m in zip(new, noise, strict=True)])


def _update(P: Array, K: Array, times: Array) -> Array:
    # P - K s K', position entries in the form that cannot cancel: they become so many times smaller
    a, b, c, d, e, f = P
    kept = 1.0 - K[0]
    first = np.where(K[0] > 0, a / times, a)
    return np.stack(
        [first, np.where(K[0] > 0, b / times, b * kept), np.where(K[0] > 0, c / times, c * kept)]
        + [d - K[1] * b, e - K[1] * c, f - K[2] * c]
    )


def smoothed(series: Series, rho: Array) -> Array:
    """Smoothed states (T, S, 3) at jerk ratios rho (S,)."""
    forward = filtered(series, rho)
    adjoint = np.zeros((3, series.value.shape[1]))
    out = np.empty_like(forward.mean)
    for t in range(len(series.dt) - 1, -1, -1):
        a, b, c, d, e, f = forward.covariance[t]
        x, y, z = adjoint
        correction = (a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z)
        out[t] = forward.mean[t] - np.stack(correction, axis=-1)
        # back through the update, then through the transition into this sample
        K = forward.gain[t]
        pulled = np.where(series.valid[t], forward.innovation[t] / forward.variance[t], 0.0)
        x = x - (K[0] * x + K[1] * y + K[2] * z) - pulled
        dt = series.dt[t]
        adjoint = np.stack([x, y + dt * x, z + dt * y + dt * dt / 2 * x])
    return out


def likeliest(series: Series, decades: tuple[float, float] = (2.0, 20.0)) -> Array:
    """Jerk ratio of each series, shape (S,), of greatest innovation likelihood, on two log grids.

    The ratio's unit is rad^2/s^5 over rad^2: 10^2 is a slow motion under heavy noise, 10^20 is
    practically noise-free.
    """
    grid = np.linspace(*decades, 13)
    best = grid[np.argmax(_likelihood(series, 10.0 ** grid[:, None]), axis=0)]
    step = grid[1] - grid[0]
    near = best + np.linspace(-step, step, 13)[:, None]
    score = _likelihood(series, 10.0**near)
    return 10.0 ** np.take_along_axis(near, np.argmax(score, axis=0)[None], axis=0)[0]


def followed(series: Series, decades: tuple[float, float] = (2.0, 20.0)) -> Array:
    """Filtered states (T, S, 3), each at the jerk ratio that its past samples make likeliest."""
    rho = 10.0 ** np.linspace(*decades, 19)[:, None]
    f = filtered(series, np.broadcast_to(rho, (len(rho), series.value.shape[1])))
    use = series.valid.copy()
    use[:3] = False  # three samples fix the state, see `_likelihood`
    use = use[:, None]
    count = np.maximum(np.cumsum(use, axis=0), 1)
    squares = np.cumsum(np.where(use, f.innovation**2 / f.variance, 0.0), axis=0)
    logs = np.cumsum(np.where(use, np.log(f.variance), 0.0), axis=0)
    score = -0.5 * (count * np.log(np.maximum(squares / count, 1e-24)) + logs)
    best = np.argmax(score, axis=1)[:, None, :, None]
    return np.take_along_axis(f.mean, best, axis=1)[:, 0]


def _likelihood(series: Series, rho: Array) -> Array:
    """Log-likelihood of the innovations, measurement variance concentrated out, shape of rho."""
    f = filtered(series, np.broadcast_to(rho, (*rho.shape[:-1], series.value.shape[1])))
    # three samples fix the state; the floor stands for the resolution of stored numbers
    use = series.valid[3:, None] if rho.ndim > 1 else series.valid[3:]
    count = np.maximum(use.sum(0), 1)
    variance = (np.where(use, f.innovation[3:] ** 2 / f.variance[3:], 0.0)).sum(0) / count
    logs = np.where(use, np.log(f.variance[3:]), 0.0).sum(0)
    return -0.5 * (count * np.log(np.maximum(variance, 1e-24)) + logs)
