"""Schema of dataset.toml: its tables and keys, their types and defaults."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from frictionid.config import Strict, checked
from frictionid.errors import InputError

from .column_toml import (
    CURRENTS,
    OWN,
    UNITS,
    ColumnNames,
    Each,
    Gears,
    Motor,
    Names,
    TorquePlace,
    as_list,
    check_per_joint,
    unit_named,
)
from .formats import part_of
from .machine_toml import Actuator, Base
from .table import Table

Directions = Each[Literal[1, -1]]
Deviations = Each[PositiveFloat]


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
        return [unit_named(name, each) for each in unit]

    def scales(self, quantity: str) -> list[float]:
        """SI value of the unit: one, or one per joint."""
        units = UNITS[quantity] | OWN[quantity]
        return [units[unit] for unit in getattr(self, quantity)]


class Signs(Strict):
    """1, or -1 where the columns count the other way round: one, or one per joint."""

    angle: Directions = [1]
    torque: Directions = [1]

    def each(self, quantity: str) -> Sequence[int]:
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
    """Files of the recordings, the span of each [s] that is used, and parameters that differ.

    split : column at whose changes new recordings begin; of a time, where it starts again
    """

    patterns: Names
    split: str | None = None
    start: NonNegativeFloat = 0.0
    stop: float = math.inf
    parameters: dict[str, dict[str, float]] = {}

    @model_validator(mode="after")
    def _span(self) -> Self:
        if not self.start < self.stop:
            raise ValueError(f"start ({self.start:g} s) must lie before stop ({self.stop:g} s)")
        return self


class Mechanism(Strict, extra="allow"):
    """Kind, or file that describes the mechanism, parameters, tolerances; other keys: options."""

    kind: str | None = None
    urdf: str | None = None
    mjcf: str | None = None
    parameters: dict[str, float] = {}
    tolerances: dict[str, float] = {}

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


class Reader(Strict, extra="allow"):
    """Reader of the files; other keys are its settings.

    It stands in place of [columns] and [units], unless its format makes tables.
    """

    kind: str

    @property
    def options(self) -> dict[str, Any]:
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
    actuator: Actuator | None = None
    base: Base | None = None
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

    @property
    def asked(self) -> ColumnNames:
        """All columns to read; those of the actuator and of the base are covariates here."""
        assert self.columns is not None
        usual, others = self.columns.time.angle, {}
        if self.actuator is not None:
            others = dict.fromkeys(self.actuator.columns(), self.actuator.time or usual)
        if self.base is not None:
            names = [name for names in self.base.columns.values() for name in names]
            others |= dict.fromkeys(names, self.base.time or usual)
        return self.columns.with_others(others) if others else self.columns

    def names(self) -> list[str]:
        """All columns to read, each once."""
        split = self.recordings.split
        return list(dict.fromkeys([*self.asked.names(), *([] if split is None else [split])]))

    def runs(self, table: Table) -> dict[str, Table]:
        """The runs in a table, by what their names add to that of the file."""
        split = self.recordings.split
        if split is None or self.columns is None:
            return {"": table}
        clocks = (self.columns.time.angle, self.columns.time.torque)
        parts = table.split(split, split if split in clocks else clocks[0])
        return {f"-{i}" if len(parts) > 1 else "": part for i, part in enumerate(parts, 1)}

    @field_validator("columns")
    @classmethod
    def _columns_or_reader(
        cls, columns: ColumnNames | None, info: ValidationInfo
    ) -> ColumnNames | None:
        reader = info.data.get("reader", ...)  # not a wrong one
        if columns is None and (reader is None or _reads_tables(reader, only=True)):
            raise PydanticCustomError(
                "missing_columns",
                "the key 'columns' is missing; add it, or a [reader] that needs none",
            )
        return columns

    @model_validator(mode="after")
    def _nothing_twice(self) -> Self:
        """What says the same, or the contrary, of one thing excludes each other."""
        tables = self.columns is not None and _reads_tables(self.reader)
        if self.reader is not None and not tables:
            for key in ("columns", "units", "hold", "motor", "actuator", "base", "signs"):
                if key in self.model_fields_set:
                    raise ValueError(f"[{key}] and [reader] exclude each other; delete one of them")
        if self.torque.at == "link" and self.motor and self.motor.torque_at_shaft:
            raise ValueError(
                'torque.at = "link", but [motor] says that the torques are of the motors: delete '
                "one of them"
            )
        if self.actuator is not None and self.columns is not None and any(self.columns.torque):
            raise ValueError(
                "[actuator] and columns.torque exclude each other: a torque that was measured "
                "drives better than one that is computed; delete one of them"
            )
        return self

    @model_validator(mode="after")
    def _one_number_per_joint(self) -> Self:
        if self.columns is None:
            return self
        joints = self.columns.angle
        if self.actuator is not None:
            self.actuator.check_joints(joints)
        coupling = self.motor and self.motor.coupling
        if coupling and len(coupling) != len(joints):
            raise ValueError(
                f"motor.coupling is of {len(coupling)} motors, and there are {len(joints)} joints; "
                "give one row per joint"
            )
        tables = {"sigma": self.sigma, "motor": self.motor or (), "signs": self.signs}
        numbers = {
            f"{table}.{key}": each
            for table, keys in tables.items()
            for key, each in keys
            if not isinstance(each, str)
        }
        units = {f"units.{label}": each for label, each in self.units if label != "time"}
        check_per_joint(numbers, joints)
        check_per_joint(units, joints, "units")
        return self

    @model_validator(mode="after")
    def _units_and_their_motor(self) -> Self:
        """Units are stated; those of the motor, currents, and what they need come together."""
        unstated = self.reader and part_of(self.reader.kind, "unstated")
        for quantity, names, why in unstated(self.columns) if unstated and self.columns else ():
            if quantity not in self.units.model_fields_set:
                raise ValueError(f"units.{quantity} of {names} must be stated: {why}")
        motor, units = self.motor or Motor(), self.units
        counted = motor.counts_per_turn is not None
        if counted != any(
            u in OWN[key] for key in ("angle", "velocity") for u in getattr(units, key)
        ):
            raise ValueError(
                'units of "counts" or "counts/s" and counts_per_turn in the table [motor] need '
                "each other; add what is missing"
            )
        permille = "permille" in units.torque
        if permille != ((motor.rated_torque or motor.rated_current) is not None):
            raise ValueError(
                'units.torque = "permille" and the table [motor] with rated_torque [N m], or '
                "rated_current [A] and kt, need each other; add what is missing"
            )
        currents = [unit for unit in units.torque if unit in CURRENTS]
        if currents and self.motor is None:
            raise ValueError(
                f'units.torque = "{currents[0]}" needs the table [motor]: add it with kt [N m/A] '
                "and gear; torque at the joint = kt gear current"
            )
        if currents and motor.kt is None:
            raise ValueError("the key 'motor.kt' is missing; add it")
        if self.motor is not None and not (currents or permille or counted):
            if motor.kt is not None:
                raise ValueError(
                    f'[motor] needs currents, but units.torque = "{units.torque[0]}": delete '
                    'kt, or correct the unit to "A"'
                )
            if motor.angle == motor.torque == "joint" and not any(motor.offset):
                raise ValueError(
                    "[motor] changes nothing where torques and angles are those of the joints: "
                    'delete it, or say torque = "motor", angle = "motor" or an offset in it'
                )
        return self


def _reads_tables(reader: object, *, only: bool = False) -> bool:
    """Whether a reader makes tables; `only`: and nothing else, so that it needs [columns]."""
    if not isinstance(reader, Reader) or part_of(reader.kind, "tables") is None:
        return False
    return not only or part_of(reader.kind, "read") is None


def check_dataset_toml(document: dict[str, Any], file: str) -> DatasetToml:
    """Checked content of a parsed dataset.toml.

    Parameters
    ----------
    document : dict, as ``tomllib`` returns it
    file : str, for errors

    Examples
    --------
    >>> check_dataset_toml({"nane": "rig"}, "dataset.toml")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: dataset.toml: unknown key 'nane'; did you mean 'name'?
    """
    if "identifiers" in document:
        raise InputError(f"{file} is a suite; name a data set: a folder with a dataset.toml")
    reader = document.get("reader")
    defaults = part_of(reader.get("kind"), "defaults") if isinstance(reader, dict) else None
    if defaults is not None:  # what the format of the tables says of itself
        document = defaults(document)
    return checked(DatasetToml, _without_torque(document), file)


def _without_torque(document: dict[str, Any]) -> dict[str, Any]:
    """The document with no columns of torque, where [actuator] makes it or nothing is driven."""
    columns, mechanism = document.get("columns"), document.get("mechanism")
    passive = isinstance(mechanism, dict) and mechanism.get("driven") is False
    if not isinstance(columns, dict) or "torque" in columns:
        return document
    if not passive and "actuator" not in document:
        return document
    joints = as_list(columns.get("angle", ""))
    none = [""] * len(joints) if isinstance(joints, list) else [""]
    return {**document, "columns": {**columns, "torque": none}}
