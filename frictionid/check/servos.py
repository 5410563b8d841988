"""What recordings of servos without a measured torque can tell, and what to record next.

Torque is computed from targets, gains and motion. How late targets act is found first, from the
balance of torques as that of a measured torque is, so that the tests see torques of that delay.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.integrals import integrals_of
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.data.servo import UNKNOWN_GAIN, Servo, servo_torque
from frictionid.data.signals import Signal, holds
from frictionid.fitting.one_step.balances import Rows

from .findings import Finding, finding
from .motion import MIN_WINDOWS, Measured, Motion, windows_of
from .partial_regression import Nuisance, PartialRegression, nuisance_of, refined_delay

_LATEST, _COARSE, _STEP = 0.06, 0.004, 0.001  # [s], of the search and of its last steps
_WIDTHS = {False: (0.15, 0.2), True: (0.1, 0.3)}  # [s] of windows, with reversals or without
_FREE = 10.0  # of a base parameter: as good as free
_WIDE = 2.5  # standard errors, as of a measured torque's delay
_CLEAR = 0.02  # of the sum of squares that a delay must explain
_PLAYS = np.radians([0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0])  # backlash that is tried
_FAST = 0.2  # of a velocity error that controllers take off within a sample
_MUCH = 0.5  # of the sum of squares that a backlash must explain


def servos_of(dataset: Dataset) -> list[Servo]:
    """Servos of the recordings in which they drive."""
    return [r.servo for r in dataset.recordings if r.servo is not None and np.any(r.torque.value)]


def with_late_targets(dataset: Dataset, motions: Sequence[Motion]) -> tuple[Dataset, list[Finding]]:
    """The data set with torques of targets as late as they act, where these are held."""
    servos = servos_of(dataset)
    if len(servos) < len(dataset.recordings) or not all(holds(s.goal) for s in servos):
        return dataset, []
    fits = [fit for fit in (_fits(dataset, motions, reversals=r) for r in (False, True)) if fit]
    if not fits:
        return dataset, []
    # with one gain set backlash would pass for Coulomb friction
    several = len(_gain_sets(servos)) > 1 and dataset.mechanism.position_units == ("rad",)
    lags = np.arange(0.0, _LATEST, _COARSE)
    both = [(fit, fit.at(0.0, lags), longer.at(0.0, lags)) for fit, longer in fits]
    fit, first, longer = min(both, key=lambda f: f[1].left / f[0].left(0.0, 0.0))
    near = first.late + _COARSE * np.arange(-1, 3)
    least = first
    if several:
        least = min((fit.at(play, near) for play in _PLAYS), key=lambda f: f.left)
    best = least if least.left < (1 - _MUCH) * first.left else first
    error = float(np.hypot(best.error, first.late - longer.late))  # of friction's shape
    best = best._replace(error=error)
    if best.left > (1 - _CLEAR) * fit.left(0.0, 0.0) or not np.isfinite(best.error):
        return dataset, []
    recordings = tuple(
        replace(r, servo=_with(r.servo, best.late, best.play), torque=t)
        for r, t in zip(dataset.recordings, fit.torques(best.late, best.play), strict=True)
    )
    return replace(dataset, recordings=recordings), list(_late_findings(best, first))


def _fits(
    dataset: Dataset, motions: Sequence[Motion], *, reversals: bool
) -> tuple["_Fit", "_Fit"] | None:
    """Fits to windows and to longer ones, with reversals of the joints or without; None of few.

    The mechanism is free: rotors that nobody has given would look like late targets.
    """
    measured = Measured.of_dataset(dataset, motions)
    out = []
    for width in _WIDTHS[reversals]:
        rows = windows_of(measured.balances, width, reversals=reversals)
        if rows.moving.any(1).sum() < MIN_WINDOWS:
            return None
        nuisance = nuisance_of(rows, measured.nominal, _FREE)
        out.append(_Fit(dataset, motions, rows, rows.required(measured.nominal), nuisance))
    return out[0], out[1]


class _Late(NamedTuple):
    """Delay of the targets [s] with its standard error, at a backlash [rad], and what is left."""

    late: float
    error: float
    play: float
    left: float


@dataclass(frozen=True, eq=False)
class _Fit:
    """The balances of a data set as functions of late targets and backlash.

    required (K, n) [N m] : what the nominal mechanism needs ; nuisance : what may be unknown
    """

    dataset: Dataset
    motions: Sequence[Motion]
    rows: Rows
    required: Array
    nuisance: Nuisance

    def at(self, play: float, lags: Array) -> _Late:
        """The best delay at a backlash, near one of some (D,) [s]."""

        def means(delays: Sequence[float]) -> list[Array]:
            return [self._means(late, play) for late in delays]

        best = float(lags[np.argmin([self.left(late, play) for late in lags])])
        steps = _STEP, _COARSE, 2
        best, error, _ = refined_delay(self.nuisance, self.required, means, best, steps)
        return _Late(best, error, play, self.left(best, play))

    def left(self, late: float, play: float) -> float:
        """Sum of squares of the balances, of one weight for all delays."""
        residual = self._plain.residual(self._means(late, play) - self.required)
        return float((residual**2).sum())

    def torques(self, late: float, play: float) -> list[Signal]:
        """Torques of the recordings, at smoothed velocities."""
        out = []
        for recording, motion in zip(self.dataset.recordings, self.motions, strict=True):
            rate = Signal(motion.states.time, motion.states.w, "linear")
            angle = Signal(motion.states.time, motion.states.q, "linear")
            servo = _with(recording.servo, late, play)
            out.append(servo_torque(servo, angle, rate=rate))
        return out

    def _means(self, late: float, play: float) -> Array:
        return self.rows.means(integrals_of(self.torques(late, play)))

    @cached_property
    def _plain(self) -> PartialRegression:
        return self.nuisance.beside(self._means(0.0, 0.0))


def servo_findings(dataset: Dataset) -> Iterator[Finding]:
    """What the recordings of servos cannot tell apart, and what would."""
    servos = servos_of(dataset)
    if not servos:
        return
    if is_fast(dataset):
        yield finding("fast_loop", {"samples": 1 / _fastest(dataset)})
    payloads = len(_payloads(dataset))
    words = {
        "payloads": f"{payloads} payloads do"
        if payloads > 1
        else "here one payload, if it is known",
        "what": "gains" if servos[0].output == "torque" else "gains and kt",
    }
    off = any((s.enabled.value <= 0.5).any() for s in servos)
    motor = "tied_motor_with_drops" if off else "tied_motor"
    yield finding(motor if servos[0].has_motor else "tied_gains", {}, words)
    sets = _gain_sets(servos)
    if any(set(gains) == {UNKNOWN_GAIN} for gains in sets):
        yield finding("placeholder_gains", {})
    if len(sets) == 1:
        yield finding("one_gain_set", {})
    if payloads == 1:
        yield finding("one_payload", {})


def servo_advice(dataset: Dataset) -> list[str]:
    """Recordings of servos to make next."""
    servos = servos_of(dataset)
    out = []
    if servos and len(_payloads(dataset)) == 1:
        out.append("one payload: add the same targets with another mass or length")
    if servos and len(_gain_sets(servos)) == 1:
        P = float(np.max(servos[0].gain))
        out.append(f"one gain set: add the same targets with P = {P / 2:.3g}, half of what it is")
    return out


def _late_findings(best: _Late, first: _Late) -> Iterator[Finding]:
    """Findings of the delay of targets and of backlash; first : the best without backlash."""
    late, margin = best.late, _WIDE * best.error
    words = {"low": late - margin, "high": late + margin, "digits": 1 if 2e3 * margin > 0.1 else 2}
    yield finding("late_targets", {"delay": late, "error": best.error}, words)
    if best.play:
        numbers = {"backlash": best.play, "explains": 1.0 - best.left / first.left}
        yield finding("backlash", numbers, {"degrees": np.degrees(best.play)})


def is_fast(dataset: Dataset) -> bool:
    """Whether controllers are so fast that torques computed from samples are no test."""
    return _fastest(dataset) >= _FAST


def _fastest(dataset: Dataset) -> float:
    """Largest share of a velocity that a controller takes off from one sample to the next."""
    plant, most = plant_of(dataset), 0.0
    for k, r in enumerate(dataset.recordings):
        if r.servo is None:
            continue
        time, q = r.angle.time, r.angle.value
        M = plant.mechanism.inertia(plant.p[k], q)
        B = r.servo.at(time).linear(q, 0.0 * q).feedback[:, 1]
        rate = B / np.diagonal(M, axis1=-2, axis2=-1)
        most = max(most, float(np.median(rate, axis=0).max() * np.median(np.diff(time))))
    return most


def _payloads(dataset: Dataset) -> set[tuple[tuple[str, float], ...]]:
    return {tuple(sorted(r.parameters.items())) for r in dataset.recordings}


def _gain_sets(servos: Sequence[Servo]) -> set[tuple[float, ...]]:
    return {(*np.ravel(s.gain), *np.ravel(s.damping)) for s in servos}


def _with(servo: Servo | None, late: float, play: float) -> Servo:
    """The servo with targets that are later, and more backlash, than it says."""
    assert servo is not None
    return replace(
        servo, target_delay=servo.target_delay + late, backlash=np.add(servo.backlash, play)
    )
