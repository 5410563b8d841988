"""The block of the torque bias: a torque sensor, or a current, whose zero is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.shooting.parameters.parameter_block import (
    Entry,
    Guess,
    checked,
    joints_of,
    with_joints,
)


@dataclass(frozen=True)
class BiasBlock:
    """Constant torque beside the logged one, for each driven joint; `prior` in N m."""

    prior: float | None = None
    name: str = "bias"
    enters: str = "torque"

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        d, sd = guess.mechanism.description, checked(self.prior, self.name)
        return tuple(
            Entry(
                block=self.name,
                name=f"torque bias of {d.joints[j]}",
                unit=d.torque_unit,
                value=float(guess.calibration.bias[j]),
                prior=sd,
                place=(j,),
            )
            for j in joints_of(guess.mechanism, driven=True)
        )

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        return guess._replace(calibration=with_joints(guess.calibration, "bias", entries, values))

    def slope(self, guess: Guess, entries: Sequence[Entry], logged: Array, later: Array) -> Array:
        eye = np.eye(guess.mechanism.n)
        return np.stack([0.0 * logged + eye[entry.place[0]] for entry in entries])
