"""Delay of the torque against the motion, from the data alone, with an interval.

At time t the mechanism feels the torque logged for t - delay. The sum of squares of the balances,
with friction and moderate changes of the mechanism free, is a function of the delay; its minimum is
the estimate, and a Gauss-Newton step there gives the error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import MIN_WINDOWS
from frictionid.check.partial_regression import Nuisance, PartialEstimate, nuisance_of
from frictionid.data.integrals import SignalIntegrals
from frictionid.fitting.one_step.balances import Rows

# Largest delay searched [s]; steps [s] of both searches and of the derivative.
WIDEST = 0.6
COARSE, FINE, STEP = 0.02, 0.001, 0.002
# Half-width of the interval in standard errors; few blocks and friction's shape widen it from 2.
WIDE = 2.5
_WINDOWS = 20_000  # of all delays that are looked at together


class Delay(NamedTuple):
    """Delay [s] (positive: the torque acts later than logged), standard error and its profile.

    explained : share of the sum of squares at no delay that this delay removes, 0 to 1
    lags (D,) [s] and profile (D,) : the coarse search, sums of squares over the smallest
    """

    seconds: float
    error: float
    explained: float
    lags: Array
    profile: Array

    @property
    def interval(self) -> tuple[float, float]:
        """Interval [s] that holds the delay in 95 of 100 cases (calibrated on simulations)."""
        return self.seconds - WIDE * self.error, self.seconds + WIDE * self.error


def delay_of(rows: Rows, torque: SignalIntegrals, nominal: Array) -> Delay | None:
    """Delay of all torques, or None where no torque varies.

    rows : with unit parameter vectors; torque : as logged; nominal : (R, nb) base parameters
    """
    logged = rows.means(torque)
    if not np.any(logged.std(axis=0) > 1e-9 * max(float(np.abs(logged).max()), 1e-300)):
        return None
    widest = min(WIDEST, _shortest(rows) / 6)
    inside = _inside(rows, widest)
    if inside.moving.any(1).sum() < MIN_WINDOWS:
        return None
    lags = np.arange(-np.floor(widest / COARSE), np.floor(widest / COARSE) + 1) * COARSE
    profile = _profile(_Given.of(inside, nominal), torque, lags)
    coarse = float(lags[np.argmin(profile)])
    near = _Given.of(_inside(rows, abs(coarse) + COARSE), nominal)
    fine = coarse + np.arange(-COARSE, COARSE + FINE / 2, FINE)
    best = float(fine[np.argmin(_profile(near, torque, fine))])
    best, step = _refined(near, torque, best)
    without = float(_profile(near, torque, np.zeros(1))[0])
    explained = 1.0 - step.left / max(without, 1e-300)
    return Delay(best, step.error, explained, lags, profile / profile.min())


def beside(delay: Delay, longer: Rows, torque: SignalIntegrals, nominal: Array) -> Delay:
    """The delay with what longer windows change of it as a further error.

    A controller feeds errors of the angle back into the torque, so that both seem to go together at
    another time than they do; in longer windows these errors weigh less.
    """
    near = _inside(longer, abs(delay.seconds) + COARSE)
    if near.moving.any(1).sum() < MIN_WINDOWS:
        return delay
    other, step = _refined(_Given.of(near, nominal), torque, delay.seconds)
    beyond = np.sqrt(max((other - delay.seconds) ** 2 - step.error**2, 0.0))
    return delay._replace(error=float(np.hypot(delay.error, beyond)))


class _Given(NamedTuple):
    """Rows, what may be unknown in their balances, and what the nominal mechanism needs (K, n)."""

    rows: Rows
    nuisance: Nuisance
    required: Array

    @staticmethod
    def of(rows: Rows, nominal: Array) -> _Given:
        nuisance = nuisance_of(rows, nominal, uncertain_mechanism=True)
        return _Given(rows, nuisance, rows.required(nominal))


def _refined(given: _Given, torque: SignalIntegrals, best: float) -> tuple[float, PartialEstimate]:
    """Delay [s] by Gauss-Newton from a near one, and the last step."""
    for _ in range(3):
        early, middle, late = given.rows.means(torque, [best - STEP, best, best + STEP])
        fit = given.nuisance.beside(middle)
        step = fit.estimate(middle - given.required, (early - late) / (2 * STEP))
        best += float(np.clip(step.value, -COARSE, COARSE))
    return best, step


def _profile(given: _Given, torque: SignalIntegrals, lags: Array) -> Array:
    """Sums of squares (D,) with each of the delays, some at a time: few rows are kept."""
    fit = given.nuisance.beside(given.rows.means(torque, lags[len(lags) // 2]))
    most = max(_WINDOWS // len(given.rows.start), 1)
    parts = (given.rows.means(torque, lags[i : i + most]) for i in range(0, len(lags), most))
    left = [(fit.residual(means - given.required) ** 2).sum(-1) for means in parts]
    return np.concatenate(left)


def _shortest(rows: Rows) -> float:
    """Length of the shortest recording [s]."""
    numbers = np.unique(rows.recording)
    return float(min(np.ptp(rows.start[rows.recording == r]) for r in numbers))


def _inside(rows: Rows, margin: float) -> Rows:
    """Rows far enough from both ends of their recording for a torque shifted by `margin`."""
    count = int(rows.recording.max()) + 1
    first, last = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(first, rows.recording, rows.start)
    np.maximum.at(last, rows.recording, rows.stop)
    early, late = rows.start - margin, rows.stop + margin
    return rows.where((early >= first[rows.recording]) & (late <= last[rows.recording]))
