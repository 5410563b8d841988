"""Calibration of the machine and its sensors, as shooting estimates it beside friction.

The true torque and angle follow from the recorded u and q:

    u_true(t) = gain u(t - delay) + bias,    q_true = q - offset

Where a servo drives, kt and R of its motors, the delay of its targets, its backlash and its
envelope may be calibrated; u then follows from its controller.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array, numbers_like
from frictionid.errors import InputError
from frictionid.mechanics import Plant

from .envelope import Envelope
from .plants import plant_of
from .recordings import Dataset, Recording
from .servo import Servo, servo_torque


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
