"""Delay of the torque against the motion, from the data alone, with an interval.

The mechanism feels at time t the torque that is logged for t - delay. The sum of squares of the
balances, with friction and moderate changes of the mechanism left open, is followed over the
delay; its minimum is the estimate, and a Gauss-Newton step there gives the error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import FEWEST, Rows
from frictionid.check.partial_regression import effect, stack_of
from frictionid.check.torque_integral import Impulse

# Largest delay looked for [s]; steps [s] of both searches and of the derivative.
WIDEST = 0.6
COARSE, FINE, STEP = 0.02, 0.001, 0.002
# Half-width of the interval in standard errors; few blocks and friction's shape widen it from 2.
WIDE = 2.5


class Delay(NamedTuple):
    """Delay [s] (positive: the torque acts later than logged), standard error and its profile.

    gain : share of the sum of squares at no delay that this delay takes away, 0 to 1
    lags (D,) [s] and profile (D,) : the coarse search, sums of squares over the smallest
    """

    seconds: float
    error: float
    gain: float
    lags: Array
    profile: Array

    @property
    def interval(self) -> tuple[float, float]:
        """Interval [s] that holds the delay in 95 of 100 cases (calibrated on simulations)."""
        return self.seconds - WIDE * self.error, self.seconds + WIDE * self.error


def delay_of(rows: Rows, impulse: Impulse, told: Array) -> Delay | None:
    """Delay of all torques, or None where no torque varies.

    rows : with unit parameter vectors; told : (R, nb) base parameters
    """
    torque = impulse.means(rows)
    if not np.any(torque.std(axis=0) > 1e-9 * max(float(np.abs(torque).max()), 1e-300)):
        return None
    widest = min(WIDEST, _shortest(rows) / 6)
    inside = _inside(rows, widest)
    if inside.free.any(1).sum() < FEWEST:
        return None
    lags = np.arange(-np.floor(widest / COARSE), np.floor(widest / COARSE) + 1) * COARSE
    profile = _profile(inside, impulse, told, lags)
    best = float(lags[np.argmin(profile)])
    near = _inside(rows, abs(best) + COARSE)
    fine = best + np.arange(-COARSE, COARSE + FINE / 2, FINE)
    left = _profile(near, impulse, told, fine)
    best = float(fine[np.argmin(left)])
    for _ in range(3):  # Gauss-Newton
        late = impulse.means(near, np.array([best - STEP, best, best + STEP]))
        stack = stack_of(near, late[1], told, loose=True)
        target = _target(near, late[1], told)
        step = effect(stack, target, (late[0] - late[2]) / (2 * STEP))
        best += float(np.clip(step.size, -COARSE, COARSE))
    none = float(_profile(near, impulse, told, np.zeros(1))[0])
    return Delay(
        best, step.error, 1.0 - step.left / max(none, 1e-300), lags, profile / profile.min()
    )


def _profile(rows: Rows, impulse: Impulse, told: Array, lags: Array) -> Array:
    late = impulse.means(rows, lags)
    stack = stack_of(rows, late[len(lags) // 2], told, loose=True)
    clean = stack.clean(_target(rows, late, told))
    out: Array = (clean**2).sum(-1)
    return out


def _target(rows: Rows, torque: Array, told: Array) -> Array:
    """Torque that the told mechanism leaves to friction, (..., K, n)."""
    rest: Array = torque - (rows.phi * told[rows.recording][:, None]).sum(-1)
    return rest


def _shortest(rows: Rows) -> float:
    numbers = np.unique(rows.recording)
    spans = [np.ptp(rows.start[rows.recording == r]) for r in numbers]
    return float(min(spans))


def _inside(rows: Rows, margin: float) -> Rows:
    """Rows far enough from both ends of their recording for a torque shifted by `margin`."""
    count = int(rows.recording.max()) + 1
    first, last = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(first, rows.recording, rows.start)
    np.maximum.at(last, rows.recording, rows.stop)
    keep = (rows.start - margin >= first[rows.recording]) & (
        rows.stop + margin <= last[rows.recording]
    )
    return Rows(*(field[keep] for field in rows))
