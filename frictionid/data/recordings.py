"""Recordings and data sets, checked when they are made."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from frictionid.data.sample_faults import first_fault
from frictionid.data.servo import Servo
from frictionid.data.signals import TORQUE_HOLD, Array, Signal
from frictionid.errors import InputError


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """Noise-free motion of a simulation.

    Attributes
    ----------
    angle : Signal, n columns [rad]
    velocity : Signal, n columns [rad/s]
    """

    angle: Signal
    velocity: Signal


@dataclass(frozen=True, eq=False)
class Recording:
    """One uninterrupted measurement of a mechanism with n joints.

    A prismatic joint has [m], [m/s] and [N] in place of [rad], [rad/s] and [N m].

    Attributes
    ----------
    name : str
    angle : Signal, n columns [rad]
        At least two samples.
    torque : Signal, n columns [N m]
        One column per joint, zero where there is no motor. Its clock may differ from the angles'
        clock, but both count from the same instant. It is held between its samples unless its
        `hold` says otherwise.
    velocity : Signal, n columns [rad/s], or None
        Measured velocity, where there is one.
    parameters : mapping of str to float
        Parameters of the mechanism that differ in this recording (such as an exchangeable mass).
    covariates : mapping of str to Signal
        Other measured quantities, in the unit of the file (temperature, voltage).
    truth : TrueMotion or None
        The noise-free motion, for simulated recordings.
    servo : Servo or None
        Controller and motors that make the torque, where known; `torque` then follows from the
        recorded motion.

    Raises
    ------
    InputError
        Where times do not increase, a value is not finite, or columns and joints disagree.

    Examples
    --------
    >>> time = np.arange(3.0)
    >>> Recording("rest", Signal(time, np.zeros((3, 2))), Signal(time, np.zeros((3, 2))))
    Recording('rest': 2 joints, 3 samples, 2 s)
    """

    name: str
    angle: Signal
    torque: Signal
    velocity: Signal | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    covariates: Mapping[str, Signal] = field(default_factory=dict)
    truth: TrueMotion | None = None
    servo: Servo | None = None

    def __post_init__(self) -> None:
        where = f"recording {self.name!r}"
        if self.torque.hold is None:
            object.__setattr__(self, "torque", self.torque._replace(hold=TORQUE_HOLD))
        for label, signal in self._motions():
            _check_signal(f"{where}, {label}", signal)
            if _columns(signal) != _columns(self.angle):
                raise InputError(
                    f"{where}: {label} has {_columns(signal)} columns and angle has "
                    f"{_columns(self.angle)}; give one column per joint"
                )
        for name, signal in self.covariates.items():
            _check_signal(f"{where}, covariate {name!r}", signal)
        if len(self.angle.time) < 2:
            raise InputError(f"{where}: angle needs at least 2 samples, it has 1")
        _check_clocks(where, self.angle, self.torque)
        for name, value in self.parameters.items():
            if not math.isfinite(value):
                raise InputError(f"{where}: parameter {name!r} must be finite, not {value}")

    def __repr__(self) -> str:
        samples, joints = np.shape(self.angle.value)
        span = self.angle.time[-1] - self.angle.time[0]
        return f"Recording({self.name!r}: {joints} joints, {samples} samples, {span:g} s)"

    def _motions(self) -> Iterator[tuple[str, Signal]]:
        """Signals with one column per joint, with their names in errors."""
        yield "angle", self.angle
        yield "torque", self.torque
        if self.velocity is not None:
            yield "velocity", self.velocity
        if self.truth is not None:
            yield "true angle", self.truth.angle
            yield "true velocity", self.truth.velocity
        if self.servo is not None:
            yield "goal", self.servo.goal
            yield "enabled", self.servo.enabled


@dataclass(frozen=True, eq=False)
class Dataset:
    """Recordings of one mechanism, and their origin.

    Attributes
    ----------
    name : str
    mechanism : mapping
        The [mechanism] table: kind, parameters and options of the kind.
    recordings : tuple of Recording
        At least one, with different names and equally many joints.
    hashes : mapping of str to str
        SHA-256 of each file that was read, under its name.
    origin : mapping of str to str
        Description, origin, licence and citation.
    truth : mapping or None
        The [truth] table, for simulated recordings.
    """

    name: str
    mechanism: Mapping[str, object]
    recordings: tuple[Recording, ...]
    hashes: Mapping[str, str] = field(default_factory=dict)
    origin: Mapping[str, str] = field(default_factory=dict)
    truth: Mapping[str, object] | None = None

    def __post_init__(self) -> None:
        if not self.recordings:
            raise InputError(f"data set {self.name!r} needs at least one recording")
        for name in (self.name, *(r.name for r in self.recordings)):
            if not name.isprintable():
                raise InputError(
                    f"{name!r} names a data set or recording and has characters that cannot be "
                    "shown: rename it"
                )
        seen: set[str] = set()
        joints = _columns(self.recordings[0].angle)
        for recording in self.recordings:
            if recording.name in seen:
                raise InputError(
                    f"data set {self.name!r}: two recordings are called {recording.name!r}; "
                    "rename one, or let the patterns match one of them"
                )
            seen.add(recording.name)
            if _columns(recording.angle) != joints:
                raise InputError(
                    f"data set {self.name!r}: recording {recording.name!r} has "
                    f"{_columns(recording.angle)} joints, the first one has {joints}"
                )


def _check_signal(where: str, signal: Signal) -> None:
    time, value = np.asarray(signal.time), np.asarray(signal.value)
    if time.ndim != 1 or value.ndim != 2 or len(time) != len(value) or value.size == 0:
        raise InputError(
            f"{where}: time must have shape (T,) and value (T, n) with T, n > 0, "
            f"not {time.shape} and {value.shape}"
        )
    if signal.hold not in (None, "linear", "previous"):
        raise InputError(f'{where}: hold must be "linear" or "previous", not {signal.hold!r}')
    fault = first_fault(time, value, ("time", *(f"column {k}" for k in range(value.shape[1]))))
    if fault:
        raise InputError(f"{where}, sample {fault[0]} (the first is 0): {fault[1]}")
    if signal.sigma is not None:
        _check_sigma(where, np.asarray(signal.sigma, float), value.shape)


def _check_sigma(where: str, sigma: Array, shape: tuple[int, ...]) -> None:
    if sigma.shape not in (shape, shape[1:]):
        raise InputError(
            f"{where}: sigma must have one entry per column, shape {shape[1:]}, or per sample, "
            f"shape {shape}, not {sigma.shape}"
        )
    wrong = ~(np.isfinite(sigma) & (sigma > 0))
    if wrong.any():
        at = f", sample {np.argwhere(wrong)[0][0]} (the first is 0)" if sigma.ndim == 2 else ""
        raise InputError(f"{where}{at}: sigma must be positive and finite, not {sigma[wrong][0]:g}")


# A torque may begin late or end early by some of its own gaps, or by this share of the motion; the
# checks find a clock that is off by less.
_GAPS, _SHARE = 5.0, 0.2


def _check_clocks(where: str, angle: Signal, torque: Signal) -> None:
    """The torque must cover the motion; it is not extrapolated.

    A held torque may be logged only where it changes: its own gaps are the measure.
    """
    late = torque.time[0] > angle.time[-1]
    early = torque.hold == "linear" and torque.time[-1] < angle.time[0]
    if late or early:
        raise InputError(
            f"{where}: torque ({torque.time[0]:g} to {torque.time[-1]:g} s) and angle "
            f"({angle.time[0]:g} to {angle.time[-1]:g} s) share no moment; both clocks must count "
            "from the same instant"
        )
    if len(torque.time) < 2 or not np.any(torque.value):
        return
    usual = np.max(np.diff(torque.time)) + np.median(np.diff(angle.time))
    missing = max(torque.time[0] - angle.time[0], angle.time[-1] - torque.time[-1])
    if missing > max(_GAPS * usual, _SHARE * (angle.time[-1] - angle.time[0])):
        raise InputError(
            f"{where}: torque is known from {torque.time[0]:g} to {torque.time[-1]:g} s only, the "
            f"angles from {angle.time[0]:g} to {angle.time[-1]:g} s: keep the common span by start "
            "and stop in [recordings]"
        )


def _columns(signal: Signal) -> int:
    return int(np.shape(signal.value)[1])
