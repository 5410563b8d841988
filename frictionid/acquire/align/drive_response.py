"""Command against measured torque: gain, bias, delay and saturation of a drive, with intervals.

measured(t) = gain command(t - delay) + bias, between the levels at which the drive saturates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from frictionid.arrays import Array

_BLOCKS = 24
_LONGEST = 0.3  # [s] of delay that is looked for
_FEWEST = 20  # samples beyond a level that make it one
_MOST = 60_000  # samples that are looked at


class Response(NamedTuple):
    """How a drive follows its command; SI units, torques at the joint.

    error (3,) : standard errors of gain, bias and delay; reach : half-width of a 95 % interval in
    standard errors; low, high : levels of saturation, infinite where there is none; left : root
    mean square that is unexplained
    """

    gain: float
    bias: float
    delay: float
    error: Array
    reach: float
    low: float
    high: float
    left: float


def response(time: Array, command: Array, measured: Array) -> Response | None:
    """Response of a drive, or None where its command never changes.

    Parameters
    ----------
    time : (K,) [s], increasing; command, measured : (K,) [N m]
    """
    spread = float(np.ptp(command))
    if len(time) < 4 * _BLOCKS or spread <= 1e-9 * max(float(np.abs(command).max()), 1e-300):
        return None
    keep = slice(0, min(len(time), _MOST))
    time, command, measured = time[keep], command[keep], measured[keep]
    theta = _fitted(np.array(_coarse(time, command, measured)), time, command, measured)
    low, high = theta[3:]
    asked = _predicted(np.array([*theta[:3], -np.inf, np.inf]), time, command)
    noise = _scale(_predicted(theta, time, command) - measured)
    # a level that the command hardly ever asks to exceed is none
    low = low if (asked < low - 2 * noise).sum() >= _FEWEST else -np.inf
    high = high if (asked > high + 2 * noise).sum() >= _FEWEST else np.inf
    theta = np.array([*theta[:3], low, high])
    left = measured - _predicted(theta, time, command)
    return Response(
        gain=float(theta[0]),
        bias=float(theta[1]),
        delay=float(theta[2]),
        error=_errors(theta, time, command, measured),
        reach=float(stdtrit(_BLOCKS - 1, 0.975)),
        low=float(low),
        high=float(high),
        left=float(np.sqrt(np.mean(left**2))),
    )


def _delayed(time: Array, command: Array, delay: float) -> Array:
    return np.asarray(np.interp(time - delay, time, command))


def _predicted(theta: Array, time: Array, command: Array) -> Array:
    gain, bias, delay, low, high = theta
    return np.asarray(np.clip(gain * _delayed(time, command, delay) + bias, low, high))


def _coarse(time: Array, command: Array, measured: Array) -> tuple[float, ...]:
    """Least squares of a line at each delay of a grid."""
    step = float(np.median(np.diff(time)))
    longest = min(_LONGEST, (time[-1] - time[0]) / 10)
    best, found = np.inf, (1.0, 0.0, 0.0)
    for delay in np.arange(-longest / 3, longest + step / 2, max(step, longest / 150)):
        c = _delayed(time, command, float(delay))
        c0, m0 = c - c.mean(), measured - measured.mean()
        gain = float(c0 @ m0) / max(float(c0 @ c0), 1e-300)
        left = float(((m0 - gain * c0) ** 2).sum())
        if left < best:
            best, found = left, (gain, float(measured.mean() - gain * c.mean()), float(delay))
    return found


def _fitted(theta: Array, time: Array, command: Array, measured: Array) -> Array:
    """Gain, bias, delay and levels, these as far out as there are samples."""
    step, spread = float(np.median(np.diff(time))), max(float(np.ptp(measured)), 1e-12)
    scale = np.array([1.0, spread, step, spread, spread])
    levels = np.quantile(measured, [0.01, 0.99])
    start = np.array([*theta[:3], *levels]) / scale

    def left(x: Array) -> Array:
        return _predicted(x * scale, time, command) - measured

    found = least_squares(left, start, loss="soft_l1", f_scale=_scale(left(start)))
    return np.asarray(found.x * scale)


def _scale(left: Array) -> float:
    return max(1.4826 * float(np.median(np.abs(left))), 1e-12)


def _errors(theta: Array, time: Array, command: Array, measured: Array) -> Array:
    """Standard errors (3,) from what blocks of time alone would change."""
    step = np.array([1e-4, 1e-6 * max(float(np.ptp(measured)), 1e-12), 1e-5])
    columns = [
        (_predicted(theta + s, time, command) - _predicted(theta - s, time, command))
        / (2 * s.sum())
        for s in np.pad(np.diag(step), ((0, 0), (0, 2)))
    ]
    J = np.stack(columns, axis=1)
    left = measured - _predicted(theta, time, command)
    block = np.arange(len(time)) * _BLOCKS // len(time)
    scale = 1.0 / np.sqrt(np.maximum((J**2).sum(axis=0), 1e-300))
    J = J * scale
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-10, hermitian=True)
    scores = np.stack([J[block == b].T @ left[block == b] for b in range(_BLOCKS)])
    matrix = _BLOCKS / (_BLOCKS - 1) * inverse @ (scores.T @ scores) @ inverse
    return np.asarray(np.sqrt(np.diag(matrix)) * scale)
