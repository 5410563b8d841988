"""Schema of the table [columns] of a dataset.toml: which column of a table holds what."""

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from frictionid.config import Strict
from frictionid.data.readers.motor_toml import as_list

Column = Annotated[str, Field(min_length=1)]


class Clocks(Strict):
    """Time columns of the clocks; that of the velocities is the angles' unless it is given."""

    angle: Column
    torque: Column
    velocity: Column | None = None


def _both_clocks(time: object) -> object:
    return {"angle": time, "torque": time} if isinstance(time, str) else time


Names = Annotated[list[str], Field(min_length=1), BeforeValidator(as_list)]


class TruthColumns(Strict):
    """Columns of the noise-free motion."""

    angle: Names
    velocity: Names


class ColumnNames(Strict):
    """Columns of the signals, one per joint; "" in ``torque`` where there is no motor.

    torque : columns of torques or, with a unit of current, of the currents of the motors
    sigma : columns of the standard deviations of the angles, in their unit
    missing : rows without angles, such as frames with a hidden dot: "refuse" them, or "drop" them
        from all signals on the angles' clock
    """

    time: Annotated[Clocks, BeforeValidator(_both_clocks)]
    angle: Names
    torque: Names
    velocity: Names | None = None
    sigma: Names | None = None
    missing: Literal["refuse", "drop"] = "refuse"
    truth: TruthColumns | None = None
    covariates: dict[str, Column] = {}

    @model_validator(mode="after")
    def _one_column_per_joint(self) -> Self:
        for label, names in self._per_joint():
            if len(names) != len(self.angle):
                raise ValueError(
                    f"{label} names {len(names)} columns and angle names {len(self.angle)}; "
                    'give one per joint ("" in torque for a joint without motor)'
                )
            if "" in names and label != "torque":
                raise ValueError(f'{label} has an empty name; only torque may have "" (no motor)')
        return self

    @model_validator(mode="after")
    def _no_column_twice(self) -> Self:
        measured = [self.time.angle, *self.angle, *filter(None, self.torque)]
        measured += self.velocity or []
        measured += {self.time.torque, self.velocity_clock} - {self.time.angle}
        for name in measured:
            if measured.count(name) > 1:
                raise ValueError(f"column {name!r} is named twice; each quantity has its own")
        return self

    @property
    def clocks(self) -> list[str]:
        """Time columns, each once."""
        return list(dict.fromkeys([self.time.angle, self.time.torque, self.velocity_clock]))

    @property
    def two_clocks(self) -> bool:
        """Whether there are different time columns, so that rows may lack the time of one."""
        return len(self.clocks) > 1

    def clock_of(self, name: str) -> str:
        """Time column of a column."""
        if name in self.torque:
            return self.time.torque
        return self.velocity_clock if name in (self.velocity or []) else self.time.angle

    @property
    def velocity_clock(self) -> str:
        """Time column of the velocities."""
        return self.time.velocity or self.time.angle

    def _per_joint(self) -> Iterator[tuple[str, list[str]]]:
        yield "angle", self.angle
        yield "torque", self.torque
        if self.velocity is not None:
            yield "velocity", self.velocity
        if self.sigma is not None:
            yield "sigma", self.sigma
        if self.truth is not None:
            yield "truth.angle", self.truth.angle
            yield "truth.velocity", self.truth.velocity

    def names(self) -> list[str]:
        """All columns to read, each once."""
        names = [self.time.angle, *self.covariates.values()]
        for _, columns in self._per_joint():
            names += columns
        if any(self.torque):
            names.append(self.time.torque)
        if self.velocity:
            names.append(self.velocity_clock)
        return [name for name in dict.fromkeys(names) if name]


class AskedColumns(ColumnNames):
    """All columns to read: those of an [actuator], which may have a clock, are covariates, too."""

    targets: list[str]
    target_clock: str

    @property
    def clocks(self) -> list[str]:
        """Time columns, each once."""
        return list(dict.fromkeys([*super().clocks, self.target_clock]))

    def clock_of(self, name: str) -> str:
        """Time column of a column."""
        return self.target_clock if name in self.targets else super().clock_of(name)
