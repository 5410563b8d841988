"""The block of a servo's motor: what a voltage becomes at the joint, and motion takes off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.shooting.parameters.parameter_block import Entry, Guess, checked

MOTOR = ("kt", "R")
_UNITS = ("N m/A", "Ohm")
_LEAST = 0.05  # of where a constant begins: it stays positive


@dataclass(frozen=True)
class ActuatorBlock:
    """Torque constant kt and friction_torque R of the motors, but for those that are `fixed`.

    With this block motor torque is no input: u = kt (V - kt w)/R of the recorded voltage V and the
    *predicted* velocity w while the motor is connected, and nothing while it is not. The back-EMF
    kt^2/R w acts like viscous friction, only that it goes with the connection: recordings with the
    motor disconnected, a fixed constant, or a prior tell the two apart. `prior` is a standard
    deviation relative to each value.
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    name: str = "actuator"
    enters: str = "actuator"

    def __post_init__(self) -> None:
        for name in self.fixed:
            if name not in MOTOR:
                raise InputError(
                    f"block 'actuator': a motor has no constant {name!r} to fix; known are "
                    f"{', '.join(MOTOR)}"
                )

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        relative = checked(self.prior, self.name)
        values = np.asarray(guess.calibration.motor, dtype=float)
        return tuple(
            Entry(
                block=self.name,
                name=name,
                unit=unit,
                value=float(value),
                low=_LEAST * float(value),
                prior=relative * float(value),
            )
            for name, unit, value in zip(MOTOR, _UNITS, values, strict=True)
            if name not in self.fixed
        )

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        motor = np.array(guess.calibration.motor, dtype=float)
        for entry, value in zip(entries, values, strict=True):
            motor[MOTOR.index(entry.name)] = value
        return guess._replace(calibration=replace(guess.calibration, motor=motor))
