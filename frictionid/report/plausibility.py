"""Whether a fitted model is physically plausible: what friction cannot do, or does without need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.plausibility import (
    asymmetry,
    cycle_work,
    lowest_dissipation,
    tail_drop,
)
from frictionid.evaluation.statistics import CERTAIN, FEWEST, CorrelatedTest, correlated_test
from frictionid.report.memory import KINDS, loops_of, middle
from frictionid.report.numbers import MINUS
from frictionid.report.sections import Model, SummaryData

PASSED, FAILED, NOTED, NOT_EVALUATED = OUTCOMES = ("passed", "failed", "noted", "not_evaluated")
DRIVES = -0.02  # of the torque's size: what lies above counts as zero
ASYMMETRIC, FALLING, WEAK = 0.02, 0.05, 0.01  # of the torque's size, above which it is said
UNBALANCED = 0.1  # of the energy that the motion implies
ENERGY = "dissipated_energy_ratio"


class Control(NamedTuple):
    """The best model without memory beside one with memory, and the test of its errors less its."""

    name: str
    test: CorrelatedTest


@dataclass(frozen=True)
class Check:
    """One physical check of a model.

    Attributes
    ----------
    name : "dissipation", "extrapolation", "cycle_work", "hysteresis", "break_away", "energy",
        "symmetry" or "tail"
    outcome : "passed"; "failed", the model is implausible; "noted", unusual, or not certain;
        "not_evaluated"
    statement : what was found, one clause
    value, low, high : of the friction of all data at the joint where it is worst, with the 95 %
        interval over the folds; NaN where there are none
    """

    name: str
    outcome: str
    statement: str
    value: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")


def checks_of(model: Model, data: SummaryData, control: Control | None = None) -> tuple[Check, ...]:
    """All checks of a model with friction torques; none of others, which have no friction.

    data : the data set that it was fitted to
    control : of a model with memory, without which its hysteresis is not judged
    """
    curves = model.curves
    if model.role == "none" or not np.isfinite(curves).all() or not np.any(curves):
        return ()
    velocity = data.description.velocity
    return (
        _dissipation("dissipation", "", velocity, curves, data),
        _extrapolation(model, data),
        _cycles(model),
        _hysteresis(model, data, control),
        _break_away(model, data),
        _energy(model, data),
        _symmetry(velocity, curves, data),
        _tail(velocity, curves, data),
    )


def failed(checks: tuple[Check, ...]) -> tuple[str, ...]:
    """Names of the checks that a model fails."""
    return tuple(check.name for check in checks if check.outcome == FAILED)


# --- One check each -------------------------------------------------------------------------------


class _Worst(NamedTuple):
    """The value at the worst joint with its interval over the folds; joint is its name."""

    value: float
    low: float
    high: float
    joint: str

    @property
    def text(self) -> str:
        """The value with its interval, in per cent."""
        if np.isnan(self.low):
            return f"{_percent(self.value)} at {self.joint}"
        return (
            f"{_percent(self.value)} at {self.joint} "
            f"(95 %: {_percent(self.low)} to {_percent(self.high)})"
        )


def _percent(share: float) -> str:
    size = round(100 * abs(share), 2)
    return f"{MINUS if share < 0 and size else ''}{size:.3g} %"


def _worst(values: Array, names: tuple[str, ...], largest: Callable[[Array], int]) -> _Worst:
    """Of values (F + 1, n), the last of all data, those of the joint that is worst."""
    joint = largest(values[-1])
    low, high = _interval(values[:-1, joint])
    return _Worst(float(values[-1, joint]), low, high, names[joint])


def _interval(values: Array) -> tuple[float, float]:
    """95 % interval of the mean of values of the folds (F,); NaN where no scatter is known."""
    if len(values) < FEWEST or not np.isfinite(values).all() or np.ptp(values) == 0:
        return float("nan"), float("nan")
    test = correlated_test(values, 0.0)
    return test.low, test.high


def _lowest(values: Array) -> int:
    return int(np.argmin(values))


def _largest(values: Array) -> int:
    return int(np.argmax(np.abs(values)))


def _outcome(beyond: bool, excluded: bool, worst: str) -> str:
    """Worst where a value is beyond its limit and its interval excludes it; else "noted" if so."""
    if not beyond:
        return PASSED
    return worst if excluded else NOTED


def _dissipation(name: str, where: str, velocity: Array, curves: Array, data: SummaryData) -> Check:
    """The torque of each joint opposes its motion at every velocity."""
    found = _worst(lowest_dissipation(velocity, curves), data.description.joints, _lowest)
    drives = found.value < DRIVES
    outcome = _outcome(drives, not found.high >= 0, FAILED)
    verb = "drives the motion" if drives else "opposes the motion"
    return Check(name, outcome, f"{verb}{where}: lowest {found.text}", *found[:3])


def _extrapolation(model: Model, data: SummaryData) -> Check:
    """The same half as fast again as the curves reach, where most laws have seen nothing."""
    if not model.beyond:
        return Check("extrapolation", NOT_EVALUATED, "the folder has no extrapolated curves")
    velocity = np.asarray(model.beyond["velocity"], dtype=float)
    curves = np.asarray(model.beyond["curves"], dtype=float)
    if not np.isfinite(curves).all():
        return Check("extrapolation", FAILED, "is not finite at 1.5 times the measured speeds")
    return _dissipation("extrapolation", " at 1.5 times the speeds", velocity, curves, data)


def _cycles(model: Model) -> Check:
    """Over closed cycles of the velocity friction that remembers must not give energy either."""
    if not model.loops:
        return Check("cycle_work", NOT_EVALUATED, "no cycles were computed: it has no memory")
    work = np.stack(
        [
            cycle_work(np.asarray(d["velocity"], float), np.asarray(d["torque"], float))
            for d in model.loops
        ],
        axis=-1,
    )
    place = _lowest(work[-1])
    value, (low, high) = float(work[-1, place]), _interval(work[:-1, place])
    outcome = _outcome(value < DRIVES, not high >= 0, FAILED)
    verb = "gives energy" if value < DRIVES else "takes energy"
    return Check("cycle_work", outcome, f"{verb} over closed cycles", value, low, high)


def _hysteresis(model: Model, data: SummaryData, control: Control | None) -> Check:
    """Open loops count where the best model without memory is practically worse."""
    loops = [
        middle(own)
        for joint in range(len(data.description.joints))
        if (own := loops_of(model, joint, "offset"))
    ]
    open_loops = [loop for loop in loops if loop.verdict in ("open", "late", "early")]
    if not loops:
        return Check("hysteresis", NOT_EVALUATED, "no loops were computed: it has no memory")
    widest = max(loops, key=lambda loop: loop.share)
    if not open_loops:
        return Check("hysteresis", PASSED, "shows no hysteresis beyond its folds", widest.share)
    words = (
        f"shows hysteresis of {_percent(widest.share)} of its torque on {KINDS['offset']} motion"
    )
    if control is None:
        return Check("hysteresis", NOT_EVALUATED, f"{words}; no control without memory")
    test, lags = control.test, {loop.verdict for loop in open_loops} <= {"late", "early"}
    if test.above >= CERTAIN and lags:
        outcome, reason = NOTED, "a lag closes it, as a torque clock that is off would"
    elif test.above >= CERTAIN:
        outcome, reason = PASSED, f"{control.name}, without memory, is practically worse"
    elif test.above <= 1 - CERTAIN:
        outcome, reason = FAILED, f"{control.name} predicts as well without memory"
    else:
        outcome, reason = NOTED, f"{control.name} may predict as well without memory"
    return Check("hysteresis", outcome, f"{words}; {reason}", widest.share)


def _break_away(model: Model, data: SummaryData) -> Check:
    """What holds a joint at rest opposes the impending motion, and is no less than sliding."""
    if not model.beyond:
        return Check("break_away", NOT_EVALUATED, "the folder has no break-away levels")
    levels = np.asarray(model.beyond["break_away"], dtype=float).min(axis=1)
    size = np.sqrt(np.mean(np.square(model.curves), axis=1))
    found = _worst(levels / np.where(size > 0, size, np.inf), data.description.joints, _lowest)
    if found.value < DRIVES:
        return Check("break_away", FAILED, f"drives a joint at rest: {found.text}", *found[:3])
    if found.value < WEAK and not model.loops:
        words = f"holds no joint at rest at {found.joint}: it creeps"
        return Check("break_away", NOTED, words, *found[:3])
    return Check("break_away", PASSED, f"holds joints at rest: {found.text}", *found[:3])


def _energy(model: Model, data: SummaryData) -> Check:
    """Over held-out motion friction takes the energy that the momentum balance is short of."""
    whole, folds = data.value(model, ENERGY), data.of_folds(model, ENERGY)
    if not np.isfinite(whole):
        return Check("energy", NOT_EVALUATED, "the energy that friction takes is not known")
    low, high = (v - 1.0 for v in _interval(folds))
    value = whole - 1.0
    excluded = not low <= 0 <= high
    outcome = _outcome(abs(value) > UNBALANCED, excluded, FAILED)
    span = "" if np.isnan(low) else f" (95 %: {_percent(low)} to {_percent(high)})"
    verb = "more" if value > 0 else "less"
    words = f"takes {_percent(abs(value))} {verb} energy than the motion implies{span}"
    return Check("energy", outcome, words, value, low, high)


def _symmetry(velocity: Array, curves: Array, data: SummaryData) -> Check:
    """Friction that differs by direction is possible, and worth a look."""
    found = _worst(asymmetry(velocity, curves), data.description.joints, _largest)
    beyond = abs(found.value) > ASYMMETRIC
    excluded = not found.low <= 0 <= found.high
    outcome = NOTED if beyond and excluded else PASSED
    return Check("symmetry", outcome, f"asymmetric by {found.text}", *found[:3])


def _tail(velocity: Array, curves: Array, data: SummaryData) -> Check:
    """Friction that falls at the fastest speeds is possible, and seldom true."""
    found = _worst(tail_drop(velocity, curves), data.description.joints, lambda v: int(v.argmax()))
    falls = found.value > FALLING
    outcome = NOTED if falls and not found.low <= 0 else PASSED
    words = "falls" if outcome == NOTED else "does not clearly fall" if falls else "does not fall"
    return Check("tail", outcome, f"{words} at the fastest speeds: {found.text}", *found[:3])
