"""Plants of data sets: the mechanism and sensors of each recording, as given or as calibrated.

Shooting estimates a calibration beside friction. The true torque and angle follow from the recorded
u and q:

    u_true(t) = gain u(t - delay) + bias,    q_true = q - offset

Where a servo drives, kt and R of its motors, the delay of its targets, its backlash and its
envelope may be calibrated; u then follows from its controller.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array, numbers_like
from frictionid.errors import InputError
from frictionid.mechanics import Plant, unit_inertia

from .envelope import Envelope
from .recordings import Dataset, Recording
from .servo import Servo, servo_torque
from .signals import sample


def plant_of(dataset: Dataset, parameters: Mapping[str, float] | None = None) -> Plant:
    """Plant of a data set with one batch entry for each recording, shape (R,).

    `parameters` replace those of the mechanism (such as a published model's inertias); parameters
    of a recording (such as an exchangeable mass) take precedence.

    Raises
    ------
    InputError
        For parameters that a machine cannot have (see `Mechanism.nominal`), columns that are
        not one per joint.
    """
    mechanism = dataset.mechanism
    _check_columns(dataset)
    # most recordings have the same parameters: these are completed and checked once
    parameter_sets = [tuple(sorted(r.parameters.items())) for r in dataset.recordings]
    different = {pairs: k for k, pairs in enumerate(dict.fromkeys(parameter_sets))}
    each = [mechanism.nominal({**(parameters or {}), **dict(pairs)}) for pairs in different]
    at = np.array([different[pairs] for pairs in parameter_sets])
    plant = Plant.from_parameters(
        mechanism, {k: np.array([e[k] for e in each])[at] for k in mechanism.defaults}
    )
    return replace(plant, slow=tuple(dataset.scales.slow.tolist()))


_UNKNOWN = (
    "the mechanism's base moves (floating = true), and nothing says how: name the columns of its "
    "IMU or pose in [base]; where it stands still or is held, leave floating out"
)
_UNUSED = "[base] says how the base moves: say floating = true in [mechanism], or delete [base]"


def _check_columns(dataset: Dataset) -> None:
    """Refuse recordings of other joints than the mechanism's."""
    mechanism = dataset.mechanism
    kind, n = mechanism.kind, mechanism.n
    for recording in dataset.recordings:
        if mechanism.floating != (recording.base_motion is not None):
            where = f"data set {dataset.name!r}, recording {recording.name!r}"
            raise InputError(f"{where}: {_UNKNOWN if mechanism.floating else _UNUSED}")
        for quantity, signal in (("angle", recording.angle), ("torque", recording.torque)):
            columns = np.shape(signal.value)[1]
            if columns != n:
                raise InputError(
                    f"data set {dataset.name!r}, recording {recording.name!r}: {columns} columns "
                    f"of {quantity}, but {kind} has {n} joint{'s' if n > 1 else ''}; give one "
                    "column per joint, or another kind in [mechanism]"
                )


def on_recorded_base(plant: Plant, recording: Recording, time: Array) -> Plant:
    """The plant with the motion of its base at times (S,) of a recording, one entry for each."""
    motion = recording.base_motion
    return plant if motion is None else plant.on_base(sample(motion, time))


def unit_inertia_plant(dataset: Dataset) -> Plant:
    """Plant of unit inertias, see `unit_inertia`, with one batch entry for each recording."""
    mechanism = unit_inertia(dataset.mechanism.position_units)
    plant = Plant.from_parameters(mechanism, {"inertia": np.ones(len(dataset.recordings))})
    return replace(plant, slow=tuple(dataset.scales.slow.tolist()))


# --- Torques that no fit of friction can use ------------------------------------------------------


def torque_without_motor(dataset: Dataset) -> dict[int, str]:
    """Joints (from 0) without motor that have a torque, each with a sentence; none is right.

    >>> from frictionid.data.recordings import Recording
    >>> from frictionid.data.signals import Signal
    >>> from frictionid.mechanics import acrobot
    >>> both = Signal(np.array([0.0, 1.0]), np.array([[0.2, 0.1], [0.0, 0.3]]))
    >>> machine = Dataset("rig", acrobot(), (Recording("a", both, both),))
    >>> torque_without_motor(machine)
    {0: "torque 1 is up to 0.2 N m (recording 'a'), but joint 1 of acrobot has no motor"}
    """
    mechanism = dataset.mechanism
    out = {}
    for j in np.flatnonzero(~np.array(mechanism.driven)).tolist():
        tops = [float(np.abs(r.torque.value[:, j]).max()) for r in dataset.recordings]
        if max(tops) > 0:
            name = dataset.recordings[int(np.argmax(tops))].name
            out[j] = (
                f"torque {j + 1} is up to {max(tops):.3g} {mechanism.torque_units[j]} "
                f"(recording {name!r}), but joint {j + 1} of {mechanism.kind} has no motor"
            )
    return out


NO_MOTOR_REMEDY = (
    'leave its column empty (""), or declare the motor (driven, or another kind, in [mechanism])'
)
LINK_TORQUE = (
    'the torques are of sensors at the links, behind motors and gears (torque.at = "link"): their '
    "friction, and the inertia of rotors, is not in what is measured, so that no fit can find it"
)
LINK_TORQUE_REMEDY = (
    'give the torques or currents of the motors; or say torque.at = "motor" if these are'
)


def refuse_torques(dataset: Dataset) -> None:
    """Raise InputError for torques that no fit of friction can use.

    Torques of joints without motor, and those that sensors at the links measure.
    """
    for sentence in torque_without_motor(dataset).values():
        raise InputError(f"data set {dataset.name!r}: {sentence}; {NO_MOTOR_REMEDY}")
    if dataset.torque_at == "link" and dataset.actuated.any():
        raise InputError(f"data set {dataset.name!r}: {LINK_TORQUE}; {LINK_TORQUE_REMEDY}")


# --- Calibration ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Calibration:
    """Base parameters of the machine and parameters of its sensors; leading axes are batches.

    Attributes
    ----------
    base : array, shape (..., nb), or None for those of the data set
    gain : array, shape (..., n) [1]
    delay : array, shape (...) [s], positive where the torque acts later than it was logged
    bias : array, shape (..., n) [N m]
    offset : array, shape (..., n) [rad]
    motor : array, shape (..., 2), kt [N m/A] and R [Ohm] of servos, or None for those of the
        recordings
    target_delay : array, shape (...) [s] of servos, or None for that of the recordings
    backlash : array, shape (..., n) [rad] of servos, or None for that of the recordings
    envelope : array, shape (..., n, 3), peak [N m], knee and no-load speed [rad/s] of servos, or
        None for those of the recordings

    >>> calibration = Calibration.ideal(2)
    >>> calibration.gain, float(calibration.delay)
    (array([1., 1.]), 0.0)
    """

    base: Array | None
    gain: Array
    delay: Array
    bias: Array
    offset: Array
    motor: Array | None = None
    target_delay: Array | None = None
    backlash: Array | None = None
    envelope: Array | None = None

    def __post_init__(self) -> None:
        for f in fields(self):
            value, is_one = getattr(self, f.name), f.name.endswith(("delay", "drift"))
            if value is None and (f.default is None or f.name == "base"):
                continue
            array = numbers_like(value, np.zeros(0), f"calibration.{f.name}")
            if value is None or not (is_one or array.ndim):
                each = "one number" if is_one else "a list of numbers, one for each joint"
                raise InputError(f"calibration.{f.name} = {value} must be {each}")
            object.__setattr__(self, f.name, array)

    @staticmethod
    def ideal(n: int, base: Array | None = None) -> "Calibration":
        """Calibration of n joints with ideal sensors."""
        return Calibration(base, np.ones(n), np.zeros(()), np.zeros(n), np.zeros(n))

    def __getitem__(self, index: Any) -> "Calibration":
        """Calibration at an index into the batch axes."""
        parts: Any = {k: None if x is None else x[index] for k, x in vars(self).items()}
        return Calibration(**parts)


def stack_calibrations(calibrations: list[Calibration]) -> Calibration:
    """One calibration with a new leading batch axis."""
    columns = ([getattr(c, f.name) for c in calibrations] for f in fields(Calibration))
    parts: Any = map(_all, columns)
    return Calibration(*parts)


def _all(values: list[Array | None]) -> Array | None:
    arrays = [value for value in values if value is not None]
    return np.stack(arrays) if len(arrays) == len(values) else None


def calibrated_servo(servo: Servo, calibration: Calibration) -> Servo:
    """The servo with what the calibration knows of its motors, targets, backlash and envelope."""
    if calibration.motor is not None:
        servo = servo.with_motor(*calibration.motor)
    if calibration.target_delay is not None:
        servo = replace(servo, target_delay=float(calibration.target_delay))
    if calibration.backlash is not None:
        servo = replace(servo, backlash=np.asarray(calibration.backlash, dtype=float))
    if calibration.envelope is not None:
        numbers = np.asarray(calibration.envelope, dtype=float)
        servo = replace(servo, envelope=Envelope(*np.moveaxis(numbers, -1, 0)))
    return servo


def calibrated_plant(dataset: Dataset, calibration: Calibration) -> Plant:
    """Plant of a data set with calibrated base parameters, one entry for each recording.

    Parameters of a recording (such as an exchangeable mass) change the base parameters as they
    change those of the table.

    Raises
    ------
    InputError
        Where the calibration is that of another mechanism.
    """
    plant = plant_of(dataset)
    if calibration.base is None:
        return plant
    nominal, count = dataset.mechanism.nominal_base, np.shape(calibration.base)[-1]
    if count != len(nominal):
        raise InputError(
            f"data set {dataset.name!r}: the model's calibration has {count} base parameters, this "
            f"mechanism has {len(nominal)} ({', '.join(plant.mechanism.base_names)})"
        )
    return replace(plant, p=plant.p + (calibration.base - nominal))


def calibrated_dataset(dataset: Dataset, calibration: Calibration) -> Dataset:
    """The data set with gain, delay, bias and offset removed, as ideal sensors would record it."""
    driven = dataset.mechanism.motors
    recordings = tuple(_calibrated(r, calibration, driven) for r in dataset.recordings)
    return replace(dataset, recordings=recordings)


def with_calibrated_servos(dataset: Dataset, calibration: Calibration | None) -> Dataset:
    """The data set with torques of servos whose motors, targets and backlash are calibrated."""
    recordings = tuple(with_calibrated_servo(r, calibration) for r in dataset.recordings)
    return replace(dataset, recordings=recordings)


def with_calibrated_servo(recording: Recording, calibration: Calibration | None) -> Recording:
    """The recording with torques of a calibrated servo."""
    if recording.servo is None or calibration is None:
        return recording
    servo = calibrated_servo(recording.servo, calibration)
    if servo is recording.servo:
        return recording
    return replace(recording, servo=servo, torque=servo_torque(servo, recording.angle))


def _calibrated(recording: Recording, calibration: Calibration, driven: Array) -> Recording:
    angle, torque, servo = recording.angle, recording.torque, recording.servo
    angle = angle._replace(value=angle.value - calibration.offset)
    if servo is not None and servo.target == "position":
        servo = replace(
            servo, goal=servo.goal._replace(value=servo.goal.value - calibration.offset)
        )
    recorded_servo, servo = servo, None if servo is None else calibrated_servo(servo, calibration)
    if servo is not None and servo is not recorded_servo:
        torque = servo_torque(servo, angle, float(calibration.delay))
    else:
        torque = torque._replace(time=torque.time + calibration.delay)
    true = (calibration.gain * torque.value + calibration.bias) * driven
    if servo is not None:
        servo = replace(
            servo,
            efficiency=calibration.gain * servo.efficiency,
            bias=calibration.gain * servo.bias + calibration.bias,
            delay=servo.delay + float(calibration.delay),
        )
    return replace(recording, angle=angle, torque=torque._replace(value=true), servo=servo)
