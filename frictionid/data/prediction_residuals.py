"""Each sample of smoothed series, predicted by the samples before, behind, and by all others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.kalman import FilterOutput, Series, initial_state, kalman_filter, predict

# Upper triangles (a, b, c, d, e, f) of covariances as matrices; signs under reversal of time.
_FULL = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_DIAGONAL = np.array([0, 3, 5])
_TURNED = np.array([1.0, -1.0, 1.0])
_TURNED_SQUARES = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])


class JerkFit(NamedTuple):
    """Jerk ratios (S,), and the filter's output at them."""

    rho: Array
    forward: FilterOutput


class Residuals(NamedTuple):
    """Measured minus predicted positions (T, S), and the standard deviations of each.

    In units of the value, and of the usual standard deviation of a measurement.

    by_all : residuals and deviations of the predictions by all other samples (deletion residuals);
    by_past, by_future : by the samples before, and behind
    """

    by_all: tuple[Array, Array]
    by_past: tuple[Array, Array]
    by_future: tuple[Array, Array]


def prediction_residuals(series: Series, left_out: Array, fit: JerkFit) -> Residuals:
    """What the other samples, without those that are left out (T, S), leave of each one.

    With the predictions x, P by the samples before and y, Q by those behind, all others predict

        x + P (P + Q)^-1 (y - x)    with covariance    P - P (P + Q)^-1 P

    fit : of the series without the samples that are left out
    """
    rows, inside = _reversal(series)
    kept = series.without(left_out)
    x, P = _by_the_past(kept, fit)
    back = _reversed(kept, rows, inside)
    y, Q = _by_the_past(back, JerkFit(fit.rho, kalman_filter(back, fit.rho)))
    y = np.take_along_axis(y, rows[None], axis=1) * _TURNED[:, None, None]
    Q = np.take_along_axis(Q, rows[None], axis=1) * _TURNED_SQUARES[:, None, None]
    scale = np.sqrt((P + Q)[_DIAGONAL])  # (3, T, S)
    total = np.moveaxis((P + Q)[_FULL] / (scale[:, None] * scale), (0, 1), (-2, -1))
    own = np.moveaxis(P[:3] / scale, 0, -1)
    share = np.linalg.solve(total, own[..., None])[..., 0]
    middle = x[0] + (share * np.moveaxis((y - x) / scale, 0, -1)).sum(axis=-1)
    variance = np.maximum(P[0] - (share * own).sum(axis=-1), 0.0)
    return Residuals(
        *(
            (series.value - mean, np.sqrt(var + series.noise))
            for mean, var in ((middle, variance), (x[0], P[0]), (y[0], Q[0]))
        )
    )


def _by_the_past(series: Series, fit: JerkFit) -> tuple[Array, Array]:
    """Means (3, T, S) and covariances (6, T, S) of the state by the samples before each one."""
    x, P = initial_state(series.value[0], series.dt[min(1, len(series.dt) - 1)])
    before = (
        np.moveaxis(fit.forward.mean[:-1], -1, 0),
        np.moveaxis(fit.forward.covariance[:-1], 1, 0),
    )
    later, wider = predict(*before, series.dt[1:], fit.rho)
    return np.concatenate([x[:, None], later], axis=1), np.concatenate([P[:, None], wider], axis=1)


def _reversal(series: Series) -> tuple[Array, Array]:
    """Rows (T, S) of the samples from last to first; behind the end, none, they are their own."""
    at = np.arange(len(series.dt))[:, None]
    length = series.valid.sum(axis=0)
    return np.where(at < length, length - 1 - at, at), at < length


def _reversed(series: Series, rows: Array, inside: Array) -> Series:
    """The series backward in time."""
    value, noise, valid = (np.take_along_axis(x, rows, axis=0) for x in series[1:4])
    later = np.minimum(rows + 1, len(rows) - 1)
    dt = np.where(inside, np.take_along_axis(series.dt, later, axis=0), series.dt)
    return Series(dt, value, noise, valid, ())
