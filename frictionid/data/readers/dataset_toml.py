"""Schema of dataset.toml: its tables and keys, their types and defaults."""

import math
from collections.abc import Iterator, Sequence
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
from pydantic_core import PydanticCustomError

from frictionid.config import Strict, checked
from frictionid.data.gears import Gears
from frictionid.data.readers.motor_toml import Motor, TorquePlace, as_list

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
    "torque": {"N m": 1.0, "mN m": 1e-3, "N cm": 1e-2, "N": 1.0, "A": 1.0, "mA": 1e-3},
}
CURRENTS = ("A", "mA")  # units of [columns] torque that need the constants of [motor]
SPELLINGS = {
    "time": {"sec": "s", "seconds": "s", "milliseconds": "ms", "µs": "us", "microseconds": "us"},
    "angle": {"radians": "rad", "degrees": "deg", "degree": "deg", "°": "deg", "turns": "rev"},
    "velocity": {"degrees/s": "deg/s", "°/s": "deg/s", "radians/s": "rad/s", "rev/min": "rpm"},
    "torque": {
        **dict.fromkeys(("Nm", "N*m", "N.m", "N·m"), "N m"),
        **dict.fromkeys(("mNm", "mN*m"), "mN m"),
        **dict.fromkeys(("Ncm", "N*cm"), "N cm"),
        **dict.fromkeys(("ampere", "amperes", "amps"), "A"),
    },
}


def unit_named(quantity: str, unit: str) -> str:
    """Unit of a quantity under the name that `UNITS` has for it.

    Raises
    ------
    ValueError
        For an unknown one, with the known ones.

    >>> unit_named("torque", "Nm"), unit_named("angle", "degrees")
    ('N m', 'deg')
    """
    known = UNITS[quantity]
    name = SPELLINGS[quantity].get(unit, unit)
    if name not in known:
        raise ValueError(f"unknown unit {unit!r}; known: {', '.join(map(repr, known))}")
    return name


Column = Annotated[str, Field(min_length=1)]


class Clocks(Strict):
    """Time columns of the two clocks."""

    angle: Column
    torque: Column


def _both_clocks(time: object) -> object:
    return {"angle": time, "torque": time} if isinstance(time, str) else time


Names = Annotated[list[str], Field(min_length=1), BeforeValidator(as_list)]
Directions = Annotated[list[Literal[1, -1]], Field(min_length=1), BeforeValidator(as_list)]
Deviations = Annotated[
    list[Annotated[float, Field(gt=0)]], Field(min_length=1), BeforeValidator(as_list)
]


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
    """Unit of each quantity in the tables: one, or one per joint."""

    time: str = "s"
    angle: Names = ["rad"]
    velocity: Names = ["rad/s"]
    torque: Names = ["N m"]

    @field_validator("*")
    @classmethod
    def _known_unit(cls, unit: str | list[str], info: ValidationInfo) -> str | list[str]:
        name = info.field_name or ""
        if isinstance(unit, str):
            return unit_named(name, unit)
        return [unit_named(name, own) for own in unit]

    def scales(self, quantity: str) -> list[float]:
        """SI value of the unit: one, or one per joint."""
        return [UNITS[quantity][unit] for unit in getattr(self, quantity)]


class Signs(Strict):
    """1, or -1 where the columns count the other way round: one, or one per joint."""

    angle: Directions = [1]
    torque: Directions = [1]

    def of(self, quantity: str) -> Sequence[int]:
        """Signs of a quantity; velocities count as the angles do, covariates as they are."""
        return (1,) if not quantity else self.torque if quantity == "torque" else self.angle


class Hold(Strict):
    """What the torque does between two samples, where it is stated."""

    torque: Literal["previous", "linear"] | None = None


class Sigma(Strict):
    """Standard deviations of the noise in the unit of the tables: one, or one per joint."""

    angle: Deviations | None = None
    velocity: Deviations | None = None
    torque: Deviations | None = None


class Recordings(Strict):
    """Files of the recordings, the span of each [s] that is used, and parameters that differ."""

    patterns: Names
    start: Annotated[float, Field(ge=0)] = 0.0
    stop: float = math.inf
    parameters: dict[str, dict[str, float]] = {}

    @model_validator(mode="after")
    def _span(self) -> Self:
        if not self.start < self.stop:
            raise ValueError(f"start ({self.start:g} s) must lie before stop ({self.stop:g} s)")
        return self


class Mechanism(BaseModel):
    """Kind, or file that describes the mechanism, and parameters; other keys are options."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True, allow_inf_nan=False)

    kind: str | None = None
    urdf: str | None = None
    mjcf: str | None = None
    parameters: dict[str, float] = {}

    @property
    def file(self) -> str:
        """Name of the file that describes the mechanism, or ""."""
        return self.urdf or self.mjcf or ""

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if self.kind is self.urdf is self.mjcf is None:
            raise PydanticCustomError(
                "missing_kind",
                "the key 'mechanism.kind' is missing; add it, or name the file that describes the "
                'mechanism, such as urdf = "arm.urdf"',
            )
        return self


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
    reader: Reader | None = None
    columns: Annotated[ColumnNames | None, Field(validate_default=True)] = None
    units: Units = Units()
    motor: Motor | None = None
    torque: TorquePlace = TorquePlace()
    signs: Signs = Signs()
    hold: Hold = Hold()
    sigma: Sigma = Sigma()
    recordings: Recordings
    sha256: dict[str, Annotated[str, Field(pattern="^[0-9a-f]{64}$")]] = {}
    truth: dict[str, Any] | None = None

    @property
    def gears(self) -> Gears | None:
        """Gears between the motors that columns are of and the joints."""
        if self.motor is None or self.columns is None:
            return None
        return self.motor.gears(len(self.columns.angle))

    @field_validator("columns")
    @classmethod
    def _columns_or_reader(
        cls, columns: ColumnNames | None, info: ValidationInfo
    ) -> ColumnNames | None:
        if columns is None and info.data.get("reader", ...) is None:  # not a wrong one
            raise PydanticCustomError(
                "missing_columns",
                "the key 'columns' is missing; add it, or a [reader] that needs none",
            )
        return columns

    @model_validator(mode="after")
    def _columns_and_reader(self) -> Self:
        if self.reader is not None:
            for key in ("columns", "units", "hold", "motor", "signs"):
                if key in self.model_fields_set:
                    raise ValueError(f"[{key}] and [reader] exclude each other; delete one of them")
        return self

    @model_validator(mode="after")
    def _no_motor_at_links(self) -> Self:
        motor = self.motor
        if self.torque.at == "link" and motor and (motor.torque == "motor" or motor.kt):
            raise ValueError(
                'torque.at = "link", but [motor] says that the torques are of the motors: delete '
                "one of them"
            )
        return self

    @model_validator(mode="after")
    def _one_number_per_joint(self) -> Self:
        if self.columns is None:
            return self
        joints = len(self.columns.angle)
        given = {f"sigma.{label}": deviations for label, deviations in self.sigma}
        if self.motor is not None:
            motor = self.motor
            given |= {"motor.kt": motor.kt, "motor.gear": motor.gear, "motor.offset": motor.offset}
            if motor.coupling is not None and len(motor.coupling) != joints:
                raise ValueError(
                    f"motor.coupling is of {len(motor.coupling)} motors, and there are {joints} "
                    "joints; give one row per joint"
                )
        given |= {f"signs.{label}": numbers for label, numbers in self.signs}
        units = {f"units.{label}": own for label, own in self.units if label != "time"}
        for label, entries in (given | units).items():
            if entries is not None and len(entries) not in (1, joints):
                what = "units" if label in units else "numbers"
                raise ValueError(
                    f"{label} has {len(entries)} {what} for {joints} joints; "
                    "give one, or one per joint"
                )
        return self

    @model_validator(mode="after")
    def _motor_of_currents(self) -> Self:
        currents = [unit for unit in self.units.torque if unit in CURRENTS]
        if currents and self.motor is not None and self.motor.kt is None:
            raise ValueError("the key 'motor.kt' is missing; add it")
        if currents and self.motor is None:
            raise ValueError(
                f'units.torque = "{currents[0]}" needs the table [motor]: add it with kt [N m/A] '
                "and gear; torque at the joint = kt gear current"
            )
        if self.motor is not None and not currents:
            if self.motor.kt is not None:
                raise ValueError(
                    f'[motor] needs currents, but units.torque = "{self.units.torque[0]}": delete '
                    'kt, or correct the unit to "A"'
                )
            if self.motor.angle == self.motor.torque == "joint":
                raise ValueError(
                    "[motor] changes nothing where torques and angles are those of the joints: "
                    'delete it, or say torque = "motor" or angle = "motor" in it'
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
