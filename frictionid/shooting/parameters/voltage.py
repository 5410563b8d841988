"""The gain of a servo's voltage: what `actuator` frees, as the intervals see it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.shooting.parameters.parameter_block import Entry, Guess


@dataclass(frozen=True)
class VoltageBlock:
    """Gain kt/R between voltage and torque, one for all joints."""

    name: str = "voltage"
    enters: str = "torque"

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        return (Entry(self.name, "kt/R", "N m/V", float(guess.calibration.gain[0])),)

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        gain = np.full(guess.mechanism.n, float(values[0]))
        return guess._replace(calibration=replace(guess.calibration, gain=gain))

    def slope(self, guess: Guess, entries: Sequence[Entry], logged: Array, later: Array) -> Array:
        return logged[None]
