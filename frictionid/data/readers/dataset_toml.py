"""Schema of dataset.toml: its tables and keys, their types and defaults."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from frictionid.config import Strict, checked

# SI value of one unit. A prismatic joint has positions and forces in place of angles and torques.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "angle": {
        "rad": 1.0,
        "mrad": 1e-3,
        "deg": math.pi / 180.0,
        "rev": 2.0 * math.pi,
        "m": 1.0,
        "mm": 1e-3,
    },
    "velocity": {
        "rad/s": 1.0,
        "deg/s": math.pi / 180.0,
        "rpm": math.pi / 30.0,
        "m/s": 1.0,
        "mm/s": 1e-3,
    },
    "torque": {"N m": 1.0, "mN m": 1e-3, "N cm": 1e-2, "N": 1.0},
}


Column = Annotated[str, Field(min_length=1)]


class Clocks(Strict):
    """Time columns of the two clocks."""

    angle: Column
    torque: Column


def _both_clocks(time: object) -> object:
    return {"angle": time, "torque": time} if isinstance(time, str) else time


def _as_list(number: object) -> object:
    return number if isinstance(number, list) else [number]


Columns = Annotated[list[str], Field(min_length=1)]
Deviations = Annotated[
    list[Annotated[float, Field(gt=0)]], Field(min_length=1), BeforeValidator(_as_list)
]


class TruthColumns(Strict):
    """Columns of the noise-free motion."""

    angle: Columns
    velocity: Columns


class ColumnNames(Strict):
    """Columns of the signals, one per joint; "" in ``torque`` where there is no motor.

    sigma : columns of the standard deviations of the angles, in their unit
    missing : rows without angles, such as frames with a hidden dot: "refuse" them, or "drop" them
        from all signals on the angles' clock
    """

    time: Annotated[Clocks, BeforeValidator(_both_clocks)]
    angle: Columns
    torque: Columns
    velocity: Columns | None = None
    sigma: Columns | None = None
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
        if self.two_clocks:
            measured.append(self.time.torque)
        for name in measured:
            if measured.count(name) > 1:
                raise ValueError(f"column {name!r} is named twice; each quantity has its own")
        return self

    @property
    def two_clocks(self) -> bool:
        """Whether angle and torque have different time columns."""
        return self.time.angle != self.time.torque

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
        return [name for name in dict.fromkeys(names) if name]


class Units(Strict):
    """Unit of each quantity in the tables."""

    time: str = "s"
    angle: str = "rad"
    velocity: str = "rad/s"
    torque: str = "N m"

    @field_validator("*")
    @classmethod
    def _known_unit(cls, unit: str, info: ValidationInfo) -> str:
        known = UNITS[info.field_name or ""]
        if unit not in known:
            raise ValueError(f"unknown unit {unit!r}; known: {', '.join(map(repr, known))}")
        return unit


class Hold(Strict):
    """What the torque does between two samples."""

    torque: Literal["previous", "linear"] = "previous"


class Sigma(Strict):
    """Standard deviations of the noise in the unit of the tables: one, or one per joint."""

    angle: Deviations | None = None
    velocity: Deviations | None = None
    torque: Deviations | None = None


class Recordings(Strict):
    """Files of the recordings, the span of each [s] that is used, and parameters that differ."""

    patterns: Annotated[list[str], Field(min_length=1)]
    start: Annotated[float, Field(ge=0)] = 0.0
    stop: float = math.inf
    parameters: dict[str, dict[str, float]] = {}

    @model_validator(mode="after")
    def _span(self) -> Self:
        if not self.start < self.stop:
            raise ValueError(f"start ({self.start:g} s) must lie before stop ({self.stop:g} s)")
        return self


class Mechanism(BaseModel):
    """Kind and parameters of the mechanism; other keys are options of the kind."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True, allow_inf_nan=False)

    kind: str
    parameters: dict[str, float] = {}


class Reader(BaseModel):
    """Reader of the files, in place of [columns] and [units]; other keys are its settings."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True, allow_inf_nan=False)

    kind: str

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the reader."""
        return dict(self.model_extra or {})


class DatasetToml(Strict):
    """A dataset.toml."""

    name: str
    description: str = ""
    origin: str = ""
    licence: str = ""
    citation: str = ""
    collection: str | None = None
    mechanism: Mechanism
    columns: ColumnNames | None = None
    reader: Reader | None = None
    units: Units = Units()
    hold: Hold = Hold()
    sigma: Sigma = Sigma()
    recordings: Recordings
    sha256: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]] = {}
    truth: dict[str, Any] | None = None

    @model_validator(mode="after")
    def _columns_or_reader(self) -> Self:
        if self.columns is None and self.reader is None:
            raise ValueError("the key 'columns' is missing; add it, or a [reader] that needs none")
        if self.reader is not None:
            for key in ("columns", "units", "hold"):
                if key in self.model_fields_set:
                    raise ValueError(f"[{key}] and [reader] exclude each other; delete one of them")
        return self

    @model_validator(mode="after")
    def _one_sigma_per_joint(self) -> Self:
        if self.columns is None:
            return self
        joints = len(self.columns.angle)
        for label, deviations in self.sigma:
            if deviations is not None and len(deviations) not in (1, joints):
                raise ValueError(
                    f"sigma.{label} has {len(deviations)} numbers for {joints} joints; "
                    "give one, or one per joint"
                )
        return self


def check_dataset_toml(document: dict[str, Any], file: str) -> DatasetToml:
    """Checked content of a parsed dataset.toml.

    Parameters
    ----------
    document : dict, as ``tomllib`` returns it
    file : str, for errors

    Raises
    ------
    InputError
        Where a key is unknown or missing, or its value has the wrong type or range.

    Examples
    --------
    >>> check_dataset_toml({"nane": "rig"}, "dataset.toml")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: dataset.toml: unknown key 'nane'; did you mean 'name'?
    """
    return checked(DatasetToml, document, file)
