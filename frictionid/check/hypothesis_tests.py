"""Tests the data for sign, unit and timing errors against the nominal mechanism.

First the conventions, then the delay, then the mechanism itself. Each test uses the data with the
errors of the earlier ones corrected, so that one fault does not raise suspicion of others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.data.integrals import SignalIntegrals
from frictionid.data.plants import NO_MOTOR_REMEDY, torque_without_motor
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.state_estimators import usual_changes
from frictionid.fitting.one_step.balances import Rows

from .conventions import (
    Scored,
    better,
    convention_findings,
    conventions_of_recordings,
    scored,
    scores,
    unexplained_shares,
)
from .findings import Finding, finding
from .hypotheses import SIZES
from .model_errors import (
    SINGLED_OUT,
    ModelError,
    constant_angle,
    findings_of,
    misfit,
    missing_rotors,
    unlogged_torque,
)
from .motion import (
    MIN_WINDOWS,
    WIDTH,
    Measured,
    motions_of,
    windows_of,
)
from .partial_regression import (
    PARAMETER_PRIOR,
    Nuisance,
    nuisance_of,
    refined_delay,
)
from .servos import is_fast, servos_of

# Largest delay searched [s]; steps [s] of both searches and of the derivative.
WIDEST = 0.6
COARSE, FINE, STEP = 0.02, 0.001, 0.002
# Half-width of the interval in standard errors; few blocks and friction's shape widen it from 2.
WIDE = 2.5
_WINDOWS = 20_000  # of all delays that are looked at together


class Delay(NamedTuple):
    """Delay [s] (positive: the torque acts later than logged) and its standard error.

    explained : share of the sum of squares at no delay that this delay removes, 0 to 1
    """

    seconds: float
    error: float
    explained: float

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
    begins = (rows.start[rows.recording == r] for r in np.unique(rows.recording))
    widest = float(min(WIDEST, min(map(np.ptp, begins)) / 6))  # of the shortest recording
    inside = _inside(rows, widest)
    if inside.moving.any(1).sum() < MIN_WINDOWS:
        return None
    lags = np.arange(-np.floor(widest / COARSE), np.floor(widest / COARSE) + 1) * COARSE
    coarse = float(lags[np.argmin(_balances(inside, nominal, torque).profile(lags))])
    near = _balances(_inside(rows, abs(coarse) + COARSE), nominal, torque)
    fine = coarse + np.arange(-COARSE, COARSE + FINE / 2, FINE)
    best, error, left = near.refined(float(fine[np.argmin(near.profile(fine))]))
    without = float(near.profile(np.zeros(1))[0])
    explained = 1.0 - left / max(without, 1e-300)
    return Delay(best, error, explained)


def beside(
    delay: Delay,
    rows: Rows,
    torque: SignalIntegrals,
    nominal: Array,
    prior: float = PARAMETER_PRIOR,
) -> Delay:
    """The delay with what other balances change of it, beyond their error, as a further error.

    Those of longer windows: a controller feeds errors of the angle back into the torque, so that
    both seem to go together at another time than they do, and weigh less there. Those of a free
    mechanism: where inertias are far off, what they leave at reversals looks like a delay.
    """
    near = _inside(rows, abs(delay.seconds) + COARSE)
    if near.moving.any(1).sum() < MIN_WINDOWS:
        return delay
    other, error, _ = _balances(near, nominal, torque, prior).refined(delay.seconds)
    beyond = np.sqrt(max((other - delay.seconds) ** 2 - error**2, 0.0))
    return delay._replace(error=float(np.hypot(delay.error, beyond)))


class _Balances(NamedTuple):
    """Balances as functions of the torque's delay.

    nuisance : what may be unknown in them ; required (K, n) : what the nominal mechanism needs
    """

    rows: Rows
    torque: SignalIntegrals
    nuisance: Nuisance
    required: Array

    def refined(self, best: float) -> tuple[float, float, float]:
        """Delay [s] by Gauss-Newton from a near one, its error, and the squares that it leaves."""

        def means(lags: Sequence[float]) -> Array:
            return self.rows.means(self.torque, lags)

        return refined_delay(self.nuisance, self.required, means, best, (STEP, COARSE, 3))

    def profile(self, lags: Array) -> Array:
        """Sums of squares (D,) with each of the delays; few rows are kept at a time."""
        fit = self.nuisance.beside(self.rows.means(self.torque, lags[len(lags) // 2]))
        most = max(_WINDOWS // len(self.rows.start), 1)
        parts = (lags[i : i + most] for i in range(0, len(lags), most))
        each = (self.rows.means(self.torque, part) - self.required for part in parts)
        return np.concatenate([(fit.residual(left) ** 2).sum(-1) for left in each])


_FREE = 10.0  # of a base parameter: as good as free


def _balances(
    rows: Rows, nominal: Array, torque: SignalIntegrals, prior: float = PARAMETER_PRIOR
) -> _Balances:
    nuisance = nuisance_of(rows, nominal, prior)
    return _Balances(rows, torque, nuisance, rows.required(nominal))


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
_COMPUTED = (
    "the torque is computed from targets: fit by shooting, where the delay of held ones is free, "
    "with the block 'backlash' free"
)
# More unexplained than this (log of the squared share) is no description of the data.
UNEXPLAINED = np.log(0.2)


@dataclass(frozen=True, eq=False)
class HypothesisTests:
    """Results of the tests, and the data with all errors corrected.

    done : False where nothing could be tested; then all results are empty
    measured, rows : corrected data and their rows ; as_given : rows of the data as given ;
    longer : rows of longer windows, None where joints reverse too often for them
    shift : [s] delay that is corrected, 0 where it is not significant
    odd : numbers of recordings that follow another convention, or fit much worse, than the others
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
    odd: frozenset[int] = frozenset()


def untested(measured: Measured) -> HypothesisTests:
    """No results, the data as they are."""
    rows = measured.rows.without(measured.dead)
    return HypothesisTests(measured, rows, rows)


def run_tests(measured: Measured) -> HypothesisTests:
    """Tests of conventions, delay and mechanism; none where no joint moves for long enough."""
    tests = untested(measured)
    if not (tests.rows.moving.sum(0) >= MIN_WINDOWS).any():
        return tests
    conventions = scores(measured)
    delay = delay_of(tests.rows, measured.torque, measured.nominal)
    fitting = better(conventions, _limit(conventions[0], tests, delay))
    coarse = is_fast(measured.dataset)  # torques that would have the sign of the angle
    if coarse:
        fitting = [s for s in fitting if not s.convention.kind.startswith("flipped")]
    corrected, rows = measured, tests.rows
    if fitting:
        best = fitting[0].convention
        corrected = measured.mapped(best.angle, best.torque, best.offset)
        rows = untested(corrected).rows
    rotors = _rotors(corrected, rows)
    if rotors is not None:
        corrected = corrected.with_base(rotors[0])
    if rotors is not None or fitting:
        delay = delay_of(rows, corrected.torque, corrected.nominal)
    longer = _longer_rows(corrected, rows)
    if delay is not None and longer is not None:
        delay = beside(delay, longer, corrected.torque, corrected.nominal)
    if delay is not None:
        delay = beside(delay, rows, corrected.torque, corrected.nominal, _FREE)
    late = _delay_findings(delay, measured.dataset)
    shift = delay.seconds if delay and late else 0.0  # a hold is corrected as well
    torque = rows.means(corrected.torque, shift)
    left = misfit(corrected, rows, torque)
    fault = (
        unlogged_torque(left, torque, measured.mechanism.driven)
        or constant_angle(left, measured)
        or findings_of(left, coarse=bool(sampling_findings(measured)))
    )
    odd = left.odd
    if any(f.kind == "unknown_cause" for f in fault) and not coarse:
        fault = list(conventions_of_recordings(corrected).values()) or fault
    if fitting and fitting[0].convention.kind in SIZES:
        differing = frozenset(conventions_of_recordings(measured))
        odd = differing if 2 * len(differing) < len(measured.motions) else odd
    findings = [*convention_findings(fitting, conventions[0]), *late, *fault]
    findings += [] if rotors is None else [rotors[1]]
    if not fitting:  # else the joints may be swapped
        findings += _motor_findings(measured)
    findings = findings or _unexplained_findings(rows, torque, corrected.nominal)
    least = min(s.score for s in (conventions[0], *fitting))
    findings = _exchanged_findings(measured, least) or findings
    return replace(
        tests,
        measured=corrected,
        rows=rows,
        longer=longer,
        done=True,
        conventions=tuple(conventions),
        delay=delay,
        shift=shift,
        model_errors=left.errors,
        findings=tuple(findings),
        odd=odd,
    )


def _rotors(measured: Measured, rows: Rows) -> tuple[Array, Finding] | None:
    """Rotors that nobody has given, at the delay that shows beside them."""
    rotors = missing_rotors(measured, rows)
    if rotors is None:
        return None
    turning = measured.with_base(rotors[0])
    delay = delay_of(rows, turning.torque, turning.nominal)
    return missing_rotors(measured, rows, delay.seconds if delay else 0.0) or rotors


def _longer_rows(measured: Measured, rows: Rows) -> Rows | None:
    """Rows of longer windows, unless joints hardly move one way for so long."""
    longer = windows_of(measured.balances, LONGER).without(measured.dead)
    count = rows.moving.sum(0)
    enough = longer.moving.sum(0) >= np.maximum(MIN_WINDOWS, 0.15 * count)
    return longer if enough[count >= MIN_WINDOWS].all() else None


def _limit(first: Scored, tests: HypothesisTests, delay: Delay | None) -> Scored:
    """The data as given, at their delay if they fit better there."""
    if delay is None:
        return first
    measured, rows = tests.measured, tests.rows
    torque = rows.means(measured.torque, delay.seconds)
    late = scored(first.convention, rows.at(measured.nominal), torque)
    return min(first, late, key=lambda s: s.score)


def _sample_interval(dataset: Dataset) -> float:
    """Usual time [s] between two samples, of torque or angle, whichever is longer."""
    longest = [
        max(usual_step(s.time) for s in (r.torque, r.angle) if len(s.time) > 1)
        for r in dataset.recordings
        if len(r.angle.time) > 1
    ]
    return float(np.median(longest)) if longest else 0.0


def _motor_findings(measured: Measured) -> list[Finding]:
    return [
        finding("torque_without_motor", {}, {"sentence": words, "remedy": NO_MOTOR_REMEDY}, j + 1)
        for j, words in torque_without_motor(measured.dataset).items()
    ]


def _delay_findings(delay: Delay | None, dataset: Dataset) -> list[Finding]:
    if delay is None:
        return []
    size, interval = abs(delay.seconds), _sample_interval(dataset)
    # far off, some delay of a nearly periodic torque explains a part of any misfit
    enough = EXPLAINS if size < UNUSABLE_DELAY else 1.0 - SINGLED_OUT
    if size < max(ERRORS * delay.error, SAMPLE * interval, LEAST) or delay.explained < enough:
        return []
    low, high = delay.interval
    numbers, words = {"delay": delay.seconds, "error": delay.error}, {"low": low, "high": high}
    if size < BETWEEN * interval:
        late = finding("hold", {**numbers, "interval": interval}, words)
    else:
        late = finding(
            "delay",
            {**numbers, "explains": delay.explained},
            {**words, "size": size, "word": "after" if delay.seconds > 0 else "before"},
            level="unusable" if size > UNUSABLE_DELAY else "",
        )
    return [replace(late, remedy=_COMPUTED) if servos_of(dataset) else late]


def _exchanged_findings(measured: Measured, score: float) -> list[Finding]:
    """A finding where the balance holds once the columns of angles and torques change places."""
    logged = measured.dataset.recordings
    if score < UNEXPLAINED or min(len(r.torque.time) for r in logged) < MIN_WINDOWS:
        return []
    recordings = [Recording(r.name, r.torque, r.angle, base_motion=r.base_motion) for r in logged]
    exchanged = replace(measured.dataset, recordings=tuple(recordings))
    best = min(s.score for s in scores(Measured.of_dataset(exchanged, motions_of(recordings))))
    numbers = {"score": best, "given": score}
    return [finding("exchanged_columns", numbers)] if best < UNEXPLAINED - 1.0 else []


def _unexplained_findings(rows: Rows, torque: Array, nominal: Array) -> list[Finding]:
    each, matters = unexplained_shares(rows.at(nominal), torque)
    score = float(each[matters].mean()) if matters.any() else -np.inf
    if score < UNEXPLAINED:
        return []
    return [finding("unexplained", {"score": score}, {"share": np.exp(score / 2)})]


# Velocity changes from sample to sample over the fast speed: beyond it samples are too few.
COARSE_SAMPLES = 0.1


def sampling_findings(measured: Measured) -> list[Finding]:
    """A finding where the velocity of a joint changes much between two samples."""
    threshold, fast = measured.speeds
    change = usual_changes([motion.states.w for motion in measured.motions], threshold) / fast
    j = int(np.argmax(change))
    if change[j] <= COARSE_SAMPLES:
        return []
    gap = np.median(np.concatenate([np.diff(motion.states.time) for motion in measured.motions]))
    words = {"gap": gap, "times": np.ceil(2 * change[j] / COARSE_SAMPLES)}
    return [finding("slow_sampling", {"change": float(change[j])}, words, j + 1)]
