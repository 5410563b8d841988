"""Whether a fitted model is physically plausible: what friction cannot do, or does without need."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.curves import (
    asymmetry,
    cycle_work,
    lowest_dissipation,
    tail_drop,
    torque_size,
)
from frictionid.evaluation.reference_model import Factor
from frictionid.evaluation.statistics import FEWEST, correlated_test

from .memory import KINDS, loops_of, middle
from .numbers import MINUS
from .sections import Model, SummaryData

PASSED, FAILED, NOTED, NOT_EVALUATED = "passed", "failed", "noted", "not_evaluated"
DRIVES = -0.02  # of the torque's size: what lies above counts as zero
ASYMMETRIC, FALLING, WEAK = 0.02, 0.05, 0.01  # of the torque's size, above which it is said
UNBALANCED = 0.1  # of the energy that the motion implies
ENERGY = "dissipated_energy_ratio"


# Name of the best model without memory beside one with memory, and the factor by which it
# is farther off.
Control = tuple[str, Factor]


class Check(NamedTuple):
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


def checks_of(model: Model, data: SummaryData, control: Control | None) -> tuple[Check, ...]:
    """All checks of a model with friction torques; none of others, which have no friction.

    data : the data set that it was fitted to
    control : of a model with memory, without which its hysteresis is not judged
    """
    curves = model.curves
    if model.role == "none" or not np.isfinite(curves).all() or not np.any(curves):
        return ()
    velocity, joints = data.description.velocity, data.description.joints
    answers: Mapping[str, _Answer] = {
        "dissipation": _dissipation("", velocity, curves, joints),
        "extrapolation": _extrapolation(model, joints),
        "cycle_work": _cycles(model),
        "hysteresis": _hysteresis(model, joints, control),
        "break_away": _break_away(model, joints),
        "energy": _energy(model, data),
        "symmetry": _symmetry(velocity, curves, joints),
        "tail": _tail(velocity, curves, joints),
    }
    return tuple(Check(name, *answer) for name, answer in answers.items())


# --- One check each: outcome, statement, and value with its interval ------------------------------

_Answer = tuple[str, str, *tuple[float, ...]]
_Joints = tuple[str, ...]


class _Worst(NamedTuple):
    """The value at the worst joint with its interval over the folds, and both with its name."""

    value: float
    low: float
    high: float
    joint: str

    @property
    def text(self) -> str:
        """The value at the joint with its interval, in per cent."""
        return f"{_percent(self.value)} at {self.joint}{_span(self.low, self.high)}"


def _percent(share: float) -> str:
    size = round(100 * abs(share), 2)
    return f"{MINUS if share < 0 and size else ''}{size:.3g} %"


def _span(low: float, high: float) -> str:
    return "" if np.isnan(low) else f" (95 %: {_percent(low)} to {_percent(high)})"


def _worst(values: Array, joints: _Joints, largest: Callable[[Array], Any]) -> _Worst:
    """Of values (F + 1, n), the last of all data, those of the joint that is worst."""
    joint = int(largest(values[-1]))
    return _Worst(float(values[-1, joint]), *_interval(values[:-1, joint]), joints[joint])


def _interval(values: Array) -> tuple[float, float]:
    """95 % interval of the mean of values of the folds (F,); NaN where no scatter is known."""
    if len(values) < FEWEST or not np.isfinite(values).all() or np.ptp(values) == 0:
        return float("nan"), float("nan")
    test = correlated_test(values, 0.0)
    return test.low, test.high


def _outcome(beyond: bool, excluded: bool) -> str:
    """Worst where a value is beyond its limit and its interval excludes it; else "noted" if so."""
    if not beyond:
        return PASSED
    return FAILED if excluded else NOTED


def _dissipation(where: str, velocity: Array, curves: Array, joints: _Joints) -> _Answer:
    """The torque of each joint opposes its motion at every velocity."""
    worst = _worst(lowest_dissipation(velocity, curves), joints, np.argmin)
    drives = worst.value < DRIVES
    verb = "drives the motion" if drives else "opposes the motion"
    outcome = _outcome(drives, not worst.high >= 0)
    return outcome, f"{verb}{where}: lowest {worst.text}", *worst[:3]


def _extrapolation(model: Model, joints: _Joints) -> _Answer:
    """Dissipation half as fast again as the curves reach, where most laws have seen nothing."""
    if model.beyond is None:
        return NOT_EVALUATED, "the folder has no extrapolated curves"
    if not np.isfinite(model.beyond.curves).all():
        return FAILED, "is not finite at 1.5 times the measured speeds"
    return _dissipation(" at 1.5 times the speeds", *model.beyond[:2], joints)


def _cycles(model: Model) -> _Answer:
    """Over closed cycles of the velocity friction that remembers must not give energy either."""
    if not model.loops:
        return NOT_EVALUATED, "no cycles were computed: it has no memory"
    work = np.stack([cycle_work(loop.velocity, loop.torque) for loop in model.loops], axis=-1)
    value, low, high, _ = _worst(work, len(model.loops) * ("",), np.argmin)
    verb = "gives energy" if value < DRIVES else "takes energy"
    outcome = _outcome(value < DRIVES, not high >= 0)
    return outcome, f"{verb} over closed cycles", value, low, high


def _hysteresis(model: Model, joints: _Joints, control: Control | None) -> _Answer:
    """Open loops count where the best model without memory is practically worse."""
    loops = [middle(offset) for j in range(len(joints)) if (offset := loops_of(model, j, "offset"))]
    if not loops:
        return NOT_EVALUATED, "no loops were computed: it has no memory"
    verdicts = {loop.verdict for loop in loops} & {"open", "late", "early"}
    widest = max(loop.share for loop in loops)
    if not verdicts:
        return PASSED, "shows no hysteresis beyond its folds", widest
    words = f"shows hysteresis of {_percent(widest)} of its torque on {KINDS['offset']} motion"
    if control is None:
        return NOT_EVALUATED, f"{words}; no control without memory"
    name, standing = control[0], control[1].standing
    if standing == "worse" and "open" not in verdicts:
        outcome, reason = NOTED, "a lag closes it, as a torque clock that is off would"
    elif standing == "worse":
        outcome, reason = PASSED, f"{name}, without memory, is practically worse"
    elif standing == "adequate":
        outcome, reason = FAILED, f"{name} predicts as well without memory"
    else:
        outcome, reason = NOTED, f"{name} may predict as well without memory"
    return outcome, f"{words}; {reason}", widest


def _break_away(model: Model, joints: _Joints) -> _Answer:
    """What holds a joint at rest opposes the impending motion, and is no less than sliding."""
    if model.beyond is None:
        return NOT_EVALUATED, "the folder has no break-away levels"
    levels = model.beyond.break_away.min(axis=1)
    worst = _worst(levels / torque_size(model.curves), joints, np.argmin)
    if worst.value < DRIVES:
        return FAILED, f"drives a joint at rest: {worst.text}", *worst[:3]
    if worst.value < WEAK and not model.loops:
        return NOTED, f"holds no joint at rest at {worst.joint}: it creeps", *worst[:3]
    return PASSED, f"holds joints at rest: {worst.text}", *worst[:3]


def _energy(model: Model, data: SummaryData) -> _Answer:
    """Over held-out motion friction takes the energy that the momentum balance is short of."""
    value = data.value(model, ENERGY) - 1.0
    if not np.isfinite(value):
        return NOT_EVALUATED, "no energy is known, or a fold implies that friction gives some"
    low, high = (v - 1.0 for v in _interval(data.of_folds(model, ENERGY)))
    outcome = _outcome(abs(value) > UNBALANCED, low > 0 or high < 0)
    amount = f"{_percent(abs(value))} {'more' if value > 0 else 'less'}"
    words = f"takes {amount} energy than the motion implies{_span(low, high)}"
    return outcome, words, value, low, high


def _symmetry(velocity: Array, curves: Array, joints: _Joints) -> _Answer:
    """Friction that differs by direction is possible, and worth a look."""
    worst = _worst(asymmetry(velocity, curves), joints, lambda v: np.argmax(np.abs(v)))
    differs = abs(worst.value) > ASYMMETRIC and not worst.low <= 0 <= worst.high
    return NOTED if differs else PASSED, f"asymmetric by {worst.text}", *worst[:3]


def _tail(velocity: Array, curves: Array, joints: _Joints) -> _Answer:
    """Friction that falls at the fastest speeds is possible, and seldom true."""
    worst = _worst(tail_drop(velocity, curves), joints, np.argmax)
    falls = worst.value > FALLING
    outcome = NOTED if falls and not worst.low <= 0 else PASSED
    words = "falls" if outcome == NOTED else "does not clearly fall" if falls else "does not fall"
    return outcome, f"{words} at the fastest speeds: {worst.text}", *worst[:3]
