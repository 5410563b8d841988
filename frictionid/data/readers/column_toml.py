"""Columns of a dataset.toml: their units, and the schemas of [columns] and [motor]."""

import math
from collections.abc import Mapping, Sequence, Sized
from typing import Annotated, Literal, NamedTuple, Self, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, field_validator, model_validator

from frictionid.arrays import Array
from frictionid.config import Strict
from frictionid.errors import InputError

# SI value of one unit. A prismatic joint has positions and forces in place of angles and torques.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
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
# Units of the motor's own, whose SI values are these times what [motor] says, as those of currents.
OWN = {"angle": {"counts": 2 * math.pi}, "velocity": {"counts/s": 2 * math.pi}}
OWN |= {"torque": {"permille": 1e-3}, "time": {}}
_SPELT = {
    "s": "sec seconds",
    "ms": "milliseconds",
    "us": "µs microseconds",
    "ns": "nanoseconds",
    "rad": "radians",
    "deg": "degrees degree °",
    "rev": "turns",
    "rad/s": "radians/s",
    "deg/s": "degrees/s °/s",
    "rpm": "rev/min",
    "N m": "Nm N*m N.m N·m",
    "mN m": "mNm mN*m",
    "N cm": "Ncm N*cm",
    "A": "ampere amperes amps",
}
# Units by their other names, of each quantity.
SPELLINGS = {
    quantity: {name: unit for unit in units for name in _SPELT.get(unit, "").split()}
    for quantity, units in UNITS.items()
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
    units = UNITS[quantity] | OWN[quantity]
    name = SPELLINGS[quantity].get(unit, unit)
    if name not in units:
        raise ValueError(f"unknown unit {unit!r}; known: {', '.join(map(repr, units))}")
    return name


def counts_of(angles: Array, *, named: bool = False) -> dict[str, float]:
    """Keys of [motor] for angles that look like counts of a smart servo; {} for others.

    These are whole numbers, 4096 of a turn or 1024 of 300 degrees, and zero is in the middle. Whole
    numbers that are named counts are those of an encoder, of 4096.

    >>> counts_of(np.array([1645.0, 2452.0])), counts_of(np.array([-90.0, 90.0]))
    ({'counts_per_turn': 4096.0, 'offset': -3.141593}, {})
    """
    read = angles[np.isfinite(angles)]
    low, high = read.min(initial=np.inf), read.max(initial=-np.inf)
    if high - low < _TURNS or np.abs(read - np.rint(read)).max() > _WHOLE:
        return {}
    for count, turn in _SERVOS:
        if 0 <= low and high < count and abs(low + high - count) < count / 2:
            return {"counts_per_turn": turn, "offset": round(-math.pi * count / turn, 6)}
    return {"counts_per_turn": _SERVOS[-1][1], "offset": 0.0} if named else {}


_TURNS, _WHOLE = 4 * math.pi, 1e-6  # fewer counts may be radians
_SERVOS = ((1024, 1228.8), (4096, 4096.0))  # counts, and those of a whole turn
_SINGULAR = 1e9  # condition number of a coupling


def as_list(value: object) -> object:
    """A value as a list of one, a list as it is."""
    return value if isinstance(value, list) else [value]


T = TypeVar("T")
Each = Annotated[list[T], Field(min_length=1), BeforeValidator(as_list)]  # one, or one per joint
Column = Annotated[str, Field(min_length=1)]


class Clocks(Strict):
    """Time columns of the clocks; that of the velocities is the angles' unless it is given."""

    angle: Column
    torque: Column
    velocity: Column | None = None


def _both_clocks(time: object) -> object:
    return {"angle": time, "torque": time} if isinstance(time, str) else time


Names = Each[str]


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
    header : false for texts without a header line: columns are then called "1", "2", ...
    """

    time: Annotated[Clocks, BeforeValidator(_both_clocks)]
    angle: Names
    torque: Names
    velocity: Names | None = None
    sigma: Names | None = None
    missing: Literal["refuse", "drop"] = "refuse"
    header: bool = True
    truth: TruthColumns | None = None
    covariates: dict[str, Column] = {}
    _others: dict[str, str] = PrivateAttr({})  # columns with a clock of their own, and that

    @model_validator(mode="after")
    def _one_column_per_joint_and_none_twice(self) -> Self:
        for label, names in self._per_joint():
            if len(names) != len(self.angle):
                raise ValueError(
                    f"{label} names {len(names)} columns and angle names {len(self.angle)}; "
                    'give one per joint ("" in torque for a joint without motor)'
                )
            if "" in names and label != "torque":
                raise ValueError(f'{label} has an empty name; only torque may have "" (no motor)')
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
        clocks = (self.time.angle, self.time.torque, self.velocity_clock)
        return list(dict.fromkeys([*clocks, *self._others.values()]))

    def clock_of(self, name: str) -> str:
        """Time column of a column."""
        if name in self._others:
            return self._others[name]
        if name in self.torque:
            return self.time.torque
        return self.velocity_clock if name in (self.velocity or []) else self.time.angle

    @property
    def velocity_clock(self) -> str:
        """Time column of the velocities."""
        return self.time.velocity or self.time.angle

    def with_others(self, others: Mapping[str, str]) -> Self:
        """All columns to read: others, each with its clock, as covariates beside these."""
        named = {f"column {name}": name for name in {**others, **dict.fromkeys(others.values())}}
        columns = self.model_copy(update={"covariates": self.covariates | named})
        columns._others = dict(others)
        return columns

    def _per_joint(self) -> list[tuple[str, list[str]]]:
        columns = {
            label: getattr(self, label) for label in ("angle", "torque", "velocity", "sigma")
        }
        if self.truth is not None:
            columns |= {f"truth.{label}": names for label, names in self.truth}
        return [(label, names) for label, names in columns.items() if names is not None]

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


class Gears(NamedTuple):
    """How the angles and torques of joints were computed from those of motors.

    motor angle = C (joint angle - zero) and joint torque = C' motor torque

    turns : array, shape (n, n), C: turns of each motor for one of each joint
    zero : array, shape (n,) [rad], joint angles at which the columns are zero
    angles, torques : whether the columns of the angles, of the torques, are of the motors
    """

    turns: Array
    zero: Array
    angles: bool
    torques: bool


def check_per_joint(
    entries: Mapping[str, Sized | None], joints: Sequence[object], what: str = "numbers"
) -> None:
    """Check that entries, by their names in dataset.toml, are one, or one per joint.

    Raises
    ------
    InputError
        With the first key that is not; to pydantic it is one of the mistakes in a document.
    """
    for label, values in entries.items():
        if values is not None and len(values) not in (1, len(joints)):
            raise InputError(
                f"{label} has {len(values)} {what} for {len(joints)} joints "
                f"({', '.join(map(str, joints))}); give one, or one per joint"
            )


Constants = Each[float]
Side = Literal["joint", "motor"]
TorqueAt = Literal["motor", "link", "command"]


class TorquePlace(Strict):
    """What the torques are.

    at : "motor", the motors', before the friction of motor and gear; "link", of sensors behind the
        gears; "command", what the motors were asked for
    """

    at: TorqueAt = "motor"


class Motor(Strict):
    """Motors and gears between what the columns hold and the joints.

    motor angle = C (joint angle - offset) and joint torque = C' motor torque, with C = coupling, or
    gear on its diagonal. Of currents, motor torque = kt current.

    kt : torque constant at the motor's shaft [N m/A]: one, or one per joint
    gear : turns of the motor for one of the joint, negative where they turn against each other
    coupling : turns of each motor (rows) for one of each joint, where motors turn several, as at a
        wrist; in place of gear
    offset : joint angles [rad] at which the columns are zero: one, or one per joint
    angle, torque : "motor" where the columns are of the motors; currents and per mille always are
    rated_torque, rated_current : of the motor [N m], [A], where the unit of torque is "permille";
        0x6076 and 0x6075 of a CiA 402 drive, which has them in mN m and mA
    counts_per_turn : of the encoder, where the unit of angle is "counts"
    """

    kt: Constants | None = None
    rated_torque: Constants | None = None
    rated_current: Constants | None = None
    counts_per_turn: Constants | None = None
    gear: Constants = [1.0]
    coupling: list[list[float]] | None = None
    offset: Constants = [0.0]
    angle: Side = "joint"
    torque: Side = "joint"

    @field_validator("kt", "gear", "rated_torque", "rated_current", "counts_per_turn")
    @classmethod
    def _not_zero(cls, values: list[float] | None) -> list[float] | None:
        if 0.0 in (values or ()):
            raise ValueError(f"{values} must not hold a zero (a decimal has a point)")
        return values

    @model_validator(mode="after")
    def _gear_or_coupling(self) -> Self:
        if self.coupling is None:
            return self
        if "gear" in self.model_fields_set:
            raise ValueError("gear and coupling exclude each other; coupling holds the gears, too")
        n = len(self.coupling)
        square = all(len(row) == n for row in self.coupling) and n
        if not square or not np.linalg.cond(np.array(self.coupling, dtype=float)) < _SINGULAR:
            raise ValueError(
                f"coupling = {self.coupling} must be a square matrix with an inverse: one row per "
                "motor, with its turns for one turn of each joint"
            )
        return self

    @model_validator(mode="after")
    def _one_rating(self) -> Self:
        if self.rated_current is not None and (self.kt is None or self.rated_torque is not None):
            raise ValueError("rated_current needs kt beside it, and excludes rated_torque")
        return self

    @property
    def torque_at_shaft(self) -> bool:
        """Whether the columns of torque are of the motors.

        >>> [Motor(gear=9.0, **keys).torque_at_shaft for keys in ({}, {"torque": "motor"})]
        [False, True]
        """
        return self.torque == "motor" or self.kt is not None or self.rated_torque is not None

    def unit(self, quantity: str) -> Array:
        """SI value of the motor's own unit of a quantity: one ampere, count, or rated torque.

        >>> Motor(rated_torque=2.5).unit("torque"), Motor(counts_per_turn=1000).unit("angle")
        (array([2.5]), array([0.001]))
        """
        if quantity != "torque":
            return 1.0 / np.array(self.counts_per_turn or [1.0])
        kt = np.array(self.rated_torque or self.kt or [1.0])
        return kt * np.array(self.rated_current or [1.0])

    def gears(self, joints: int) -> Gears:
        """What stands between the columns and the joints."""
        zero = np.broadcast_to(np.array(self.offset, dtype=float), joints)
        return Gears(self.matrix(joints), zero, self.angle == "motor", self.torque_at_shaft)

    def matrix(self, joints: int) -> Array:
        """C (n, n): turns of each motor for one of each joint."""
        if self.coupling is not None:
            return np.array(self.coupling, dtype=float)
        return np.diag(np.broadcast_to(np.array(self.gear, dtype=float), joints))
