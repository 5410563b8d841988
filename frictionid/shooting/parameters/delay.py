"""The block of the torque delay: between the torque's clock and the angles'."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.shooting.parameters.parameter_block import Entry, Guess, checked


@dataclass(frozen=True)
class DelayBlock:
    """How much later than logged the motor torque acts [s], within `most` either way.

    It is continuous: the logged torque is averaged over each piece of time as it was logged, held
    or interpolated. `prior` in s.
    """

    most: float = 0.2
    prior: float | None = None
    name: str = "delay"
    enters: str = "torque"

    def __post_init__(self) -> None:
        if not self.most > 0:
            raise InputError(f"block 'delay': most = {self.most} s must be positive")

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        sd = checked(self.prior, self.name)
        entry = Entry(
            block=self.name,
            name="torque delay",
            unit="s",
            value=float(guess.calibration.delay),
            low=-self.most,
            high=self.most,
            prior=sd,
        )
        return (entry,)

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        return guess._replace(
            calibration=replace(guess.calibration, delay=np.asarray(float(values[0])))
        )

    def slope(self, guess: Guess, entries: Sequence[Entry], logged: Array, later: Array) -> Array:
        return (guess.calibration.gain * later)[None]
