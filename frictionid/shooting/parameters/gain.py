"""The block of the torque gain: a wrong gear ratio or torque constant."""

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
class GainBlock:
    """Factor between logged and true motor torque, one for each driven joint."""

    prior: float | None = None
    name: str = "gain"
    enters: str = "torque"

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        joints, sd = guess.mechanism.description.joints, checked(self.prior, self.name)
        return tuple(
            Entry(
                block=self.name,
                name=f"torque gain of {joints[j]}",
                unit="1",
                value=float(guess.calibration.gain[j]),
                low=0.0,
                prior=sd,
                place=(j,),
            )
            for j in joints_of(guess.mechanism, driven=True)
        )

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        return guess._replace(calibration=with_joints(guess.calibration, "gain", entries, values))

    def slope(self, guess: Guess, entries: Sequence[Entry], logged: Array, later: Array) -> Array:
        eye = np.eye(guess.mechanism.n)
        return np.stack([logged * eye[entry.place[0]] for entry in entries])
