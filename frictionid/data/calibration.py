"""Calibration of the machine and its sensors, as shooting estimates it beside friction.

The true torque and angle follow from the recorded u and q:

    u_true(t) = gain u(t - delay) + bias,    q_true = q - offset

Where a servo drives, kt and R of its motors may be calibrated; u then follows from its voltage.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import servo_torque
from frictionid.errors import InputError
from frictionid.mechanics import Plant


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

    @staticmethod
    def ideal(n: int, base: Array | None = None) -> Calibration:
        """Calibration of n joints with ideal sensors."""
        return Calibration(base, np.ones(n), np.zeros(()), np.zeros(n), np.zeros(n))

    def __getitem__(self, index: Any) -> Calibration:
        """Calibration at an index into the batch axes."""
        base, motor = (None if x is None else x[index] for x in (self.base, self.motor))
        gain, delay, bias, offset = (getattr(self, name)[index] for name in _SENSORS)
        return Calibration(base, gain, delay, bias, offset, motor)


def stack_calibrations(calibrations: list[Calibration]) -> Calibration:
    """One calibration with a new leading batch axis."""
    parts = {name: np.stack([getattr(r, name) for r in calibrations]) for name in _SENSORS}
    return Calibration(
        _all([r.base for r in calibrations]), **parts, motor=_all([r.motor for r in calibrations])
    )


def _all(values: list[Array | None]) -> Array | None:
    known = [value for value in values if value is not None]
    return np.stack(known) if len(known) == len(values) else None


_SENSORS = ("gain", "delay", "bias", "offset")


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
    mechanism = dataset.mechanism
    nominal = mechanism.base(mechanism.nominal())
    if np.shape(calibration.base)[-1] != len(nominal):
        names = ", ".join(plant.mechanism.base_names)
        raise InputError(
            f"data set {dataset.name!r}: the model's calibration has "
            f"{np.shape(calibration.base)[-1]} base parameters, this mechanism has {len(nominal)} "
            f"({names})"
        )
    return replace(plant, p=plant.p + (calibration.base - nominal))


def calibrated_dataset(dataset: Dataset, calibration: Calibration) -> Dataset:
    """The data set with gain, delay, bias and offset removed, as ideal sensors would record it."""
    driven = dataset.mechanism.motors
    recordings = tuple(_calibrated(r, calibration, driven) for r in dataset.recordings)
    return replace(dataset, recordings=recordings)


def _calibrated(recording: Recording, calibration: Calibration, driven: Array) -> Recording:
    angle, torque, servo = recording.angle, recording.torque, recording.servo
    angle = angle._replace(value=angle.value - calibration.offset)
    if servo is not None:
        servo = replace(
            servo, goal=servo.goal._replace(value=servo.goal.value - calibration.offset)
        )
    if servo is not None and calibration.motor is not None:
        servo = servo.with_motor(*calibration.motor)
        torque = servo_torque(servo, angle, float(calibration.delay))
    else:
        torque = torque._replace(time=torque.time + calibration.delay)
    true = (calibration.gain * torque.value + calibration.bias) * driven
    return replace(recording, angle=angle, torque=torque._replace(value=true), servo=servo)
