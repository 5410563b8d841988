"""Loops over the samples of the Kalman filter and the smoother, compiled.

Slices that are set, and medians of NumPy, would take seconds to compile.

Each sample depends on the one before, so that arrays of NumPy cannot hold the loop. Series are
(S, T): samples of one series stand side by side. G jerk ratios of each series are tried at once.
State and covariance are (x, v, w) and (a, b, c, d, e, f), see `kalman`.
"""

import math
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import compiled, inlined

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
