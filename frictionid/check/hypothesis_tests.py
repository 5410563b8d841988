"""Tests the data for sign, unit and timing errors against the nominal mechanism.

First the conventions, then the delay, then the mechanism itself. Each test uses the data with the
errors of the earlier ones corrected, so that one fault does not raise suspicion of others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.clock import sampling_findings
from frictionid.check.conventions import MARGIN, Scored, better, log_unexplained, scored, scores
from frictionid.check.findings import Finding, percent
from frictionid.check.model_errors import ModelError
from frictionid.check.motion import MIN_WINDOWS, WIDTH, Measured, windows_of
from frictionid.check.partial_regression import Nuisance, PartialEstimate, nuisance_of
from frictionid.check.rivals import (
    SINGLED_OUT,
    constant_angle,
    findings_of,
    misfit,
    unlogged_torque,
)
from frictionid.data.integrals import SignalIntegrals
from frictionid.data.plants import NO_MOTOR_REMEDY, torque_without_motor
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


# A torque is called late where its delay exceeds this many standard errors and this time [s], and
# removes this share of the sum of squares (healthy: at most 0.03).
ERRORS, LEAST, EXPLAINS = 4.0, 0.002, 0.1
# Within this share of a sample, what the torque does between samples looks the same: held and
# interpolated differ by half an interval. Below the lower one it does not matter.
SAMPLE, BETWEEN = 0.35, 0.65
# Length [s] of the windows that show what errors of the motion do to an estimate.
LONGER = 4 / 3 * WIDTH
# A later torque [s] makes every rollout useless.
UNUSABLE_DELAY = 0.1
# More unexplained than this (log of the squared share) is no description of the data.
UNEXPLAINED = np.log(0.2)


@dataclass(frozen=True, eq=False)
class HypothesisTests:
    """Results of the tests, and the data with all errors corrected.

    done : False where nothing could be tested; then all results are empty
    measured, rows : corrected data and their rows ; as_given : rows of the data as given ;
    longer : rows of longer windows, None where joints reverse too often for them
    shift : [s] delay that is corrected, 0 where it is not significant
    """

    measured: Measured
    rows: Rows
    as_given: Rows
    longer: Rows | None = None
    done: bool = False
    conventions: tuple[Scored, ...] = ()
    delay: Delay | None = None
    shift: float = 0.0
    model_errors: tuple[ModelError, ...] = ()
    findings: tuple[Finding, ...] = ()


def untested(measured: Measured) -> HypothesisTests:
    """No results, the data as they are."""
    rows = windows_of(measured.balances).without(measured.dead)
    return HypothesisTests(measured, rows, rows)


def run_tests(measured: Measured) -> HypothesisTests:
    """Tests of conventions, delay and mechanism; none where no joint moves for long enough."""
    tests = untested(measured)
    given, nominal = tests.as_given, measured.nominal
    if not (given.moving.sum(0) >= MIN_WINDOWS).any():
        return tests
    conventions, delay = scores(measured), delay_of(given, measured.torque, nominal)
    fitting = better(conventions, _limit(conventions[0], measured, given, delay))
    corrected, rows = measured, given
    if fitting:
        best = fitting[0].convention
        corrected = measured.mapped(best.angle, best.torque, best.zero)
        rows = windows_of(corrected.balances).without(corrected.dead)
        delay = delay_of(rows, corrected.torque, nominal)
    longer = _longer_rows(corrected, rows)
    if delay is not None and longer is not None:
        delay = beside(delay, longer, corrected.torque, nominal)
    late = _delay_findings(delay, _sample_interval(measured))
    shift = delay.seconds if delay and late else 0.0  # a hold is corrected as well
    torque = rows.means(corrected.torque, shift)
    left = misfit(corrected, rows, torque)
    fault = unlogged_torque(left, torque, measured.mechanism.driven)
    fault = fault or constant_angle(left, measured)
    fault = fault or findings_of(left, coarse=bool(sampling_findings(measured)))
    findings = [*_convention_findings(fitting, conventions[0]), *late, *fault]
    if not fitting:  # else the joints may be swapped
        findings += _motor_findings(measured)
    findings = findings or _unexplained_findings(rows, torque, nominal)
    return HypothesisTests(
        corrected,
        rows,
        given,
        longer,
        True,
        tuple(conventions),
        delay,
        shift,
        left.errors,
        tuple(findings),
    )


def _longer_rows(measured: Measured, rows: Rows) -> Rows | None:
    """Rows of longer windows, unless joints hardly move one way for so long."""
    longer = windows_of(measured.balances, LONGER).without(measured.dead)
    count = rows.moving.sum(0)
    enough = longer.moving.sum(0) >= np.maximum(MIN_WINDOWS, 0.15 * count)
    return longer if enough[count >= MIN_WINDOWS].all() else None


def _limit(given: Scored, measured: Measured, rows: Rows, delay: Delay | None) -> Scored:
    """The data as given, at their delay if they fit better there."""
    if delay is None:
        return given
    torque = rows.means(measured.torque, delay.seconds)
    late = scored(given.convention, rows.at(measured.nominal), torque)
    return min(given, late, key=lambda s: s.score)


def _score(rows: Rows, torque: Array, nominal: Array) -> float:
    return float(log_unexplained(rows.at(nominal), torque).mean())


def _sample_interval(measured: Measured) -> float:
    """Usual time [s] between two samples, of torque or angle, whichever is longer."""
    longest = [
        max(float(np.median(np.diff(s.time))) for s in (r.torque, r.angle) if len(s.time) > 1)
        for r in measured.dataset.recordings
        if len(r.angle.time) > 1
    ]
    return float(np.median(longest)) if longest else 0.0


def _convention_findings(fitting: list[Scored], given: Scored) -> list[Finding]:
    if not fitting:
        return []
    first = fitting[0].convention
    others = [s.convention.words for s in fitting[1:] if s.convention.kind != "as_given"]
    also = f" (or, equivalently: {'; '.join(others)})" if others else ""
    # beside friction the mechanism's terms are small: a wrong ratio may look like a wrong sign
    weak = given.score - fitting[0].score < MARGIN and fitting[0].of_gears
    also += ", or its ratio or coupling is wrong" if weak else ""
    return [
        Finding(
            first.kind,
            "doubtful" if weak else "unusable",
            f"{first.words}{also}: corrected, the nominal mechanism leaves "
            f"{percent_unexplained(fitting[0].score)} of the torque unexplained instead of "
            f"{percent_unexplained(given.score)}",
            "correct the columns or units in dataset.toml or in the tables; the other checks use "
            "corrected data",
            None,
            {"score": fitting[0].score, "given": given.score},
        )
    ]


def _between_samples(delay: Delay, interval: float) -> Finding:
    low, high = delay.interval
    return Finding(
        "hold",
        "good",
        f"the motion asks for a torque shifted by {1e3 * low:.1f} to {1e3 * high:.1f} ms, less "
        f"than its interval between samples ({1e3 * interval:.3g} ms): held or interpolated "
        "between samples, or late; the data cannot tell these apart",
        'correct torque = "previous" or "linear" under [hold], or fit the delay',
        None,
        {"delay": delay.seconds, "error": delay.error, "interval": interval},
    )


def _motor_findings(measured: Measured) -> list[Finding]:
    return [
        Finding("torque_without_motor", "unusable", sentence, NO_MOTOR_REMEDY, j + 1)
        for j, sentence in torque_without_motor(measured.dataset).items()
    ]


def percent_unexplained(score: float) -> str:
    """Share of the torque that a score, see `log_unexplained`, leaves unexplained.

    >>> percent_unexplained(2 * np.log(0.068))
    '6.8 %'
    """
    return percent(float(np.exp(score / 2)))


def _delay_findings(delay: Delay | None, interval: float) -> list[Finding]:
    if delay is None:
        return []
    least = max(ERRORS * delay.error, SAMPLE * interval, LEAST)
    # far off, some delay of a nearly periodic torque explains a part of any misfit
    enough = EXPLAINS if abs(delay.seconds) < UNUSABLE_DELAY else 1.0 - SINGLED_OUT
    if abs(delay.seconds) < least or delay.explained < enough:
        return []
    low, high = delay.interval
    if abs(delay.seconds) < BETWEEN * interval:
        return [_between_samples(delay, interval)]
    word = "after" if delay.seconds > 0 else "before"
    return [
        Finding(
            "delay",
            "unusable" if abs(delay.seconds) > UNUSABLE_DELAY else "doubtful",
            f"the torque acts {1e3 * abs(delay.seconds):.1f} ms {word} it is logged "
            f"(95 %: {1e3 * low:.1f} to {1e3 * high:.1f} ms); an uncorrected delay looks like "
            "viscous friction and like memory",
            "shift the torque's clock, or fit the delay (calibration parameters)",
            None,
            {"delay": delay.seconds, "error": delay.error, "explains": delay.explained},
        )
    ]


def _unexplained_findings(rows: Rows, torque: Array, nominal: Array) -> list[Finding]:
    score = _score(rows, torque, nominal)
    if score < UNEXPLAINED:
        return []
    return [
        Finding(
            "unexplained",
            "doubtful",
            f"the nominal mechanism leaves {100 * np.exp(score / 2):.0f} % of the torque "
            "unexplained, whatever the friction, and no tested error explains it",
            "check that mechanism, columns and units belong to these recordings",
            None,
            {"score": score},
        )
    ]
