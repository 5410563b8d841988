"""The block of the angle offsets: encoders or cameras whose zero is not the mechanism's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from frictionid.arrays import Array
from frictionid.shooting.parameters.parameter_block import (
    Entry,
    Guess,
    checked,
    joints_of,
    with_joints,
)


@dataclass(frozen=True)
class OffsetBlock:
    """What the measured angle of each joint lies above the true one; `prior` in rad."""

    prior: float | None = None
    name: str = "offset"
    enters: str = "angle"

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        d, sd = guess.mechanism.description, checked(self.prior, self.name)
        return tuple(
            Entry(
                block=self.name,
                name=f"angle offset of {d.joints[j]}",
                unit=d.angle_unit,
                value=float(guess.calibration.offset[j]),
                prior=sd,
                place=(j,),
            )
            for j in joints_of(guess.mechanism, driven=False)
        )

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        return guess._replace(calibration=with_joints(guess.calibration, "offset", entries, values))
