"""What rig.toml says of a real rig: its mechanism, its motors, and the protocol of their drive."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from frictionid.acquire.protocol import Format
from frictionid.config import Strict, mistake, nearest
from frictionid.data.readers.table import content_of
from frictionid.errors import InputError

# Tables of rig.toml that are read here; those of the simulated rig and the camera are theirs.
TABLES = ("motor", "protocol", "mechanism")


class Motor(Strict):
    """A motor and the columns of its drive.

    kt : torque constant [N m/A] at the motor's shaft; gear : turns of the motor for one of the
    joint, negative where they turn against each other; current : column [A]; command : column, or
    "" where the drive reports none; command_unit : of that column and of what the drive obeys, a
    torque at the joint or a current; limit : largest torque at the joint [N m]
    torque : column [N m], where the drive reports the joint's torque itself
    """

    kt: float | None = None
    gear: float = 1.0
    current: str = "current"
    torque: str = ""
    command: str = "command"
    command_unit: Literal["N m", "A"] = "N m"
    limit: Annotated[float, Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _known(self) -> Self:
        if not self.torque and self.kt is None:
            raise ValueError(
                "the key 'kt' is missing: torque = kt gear current needs the torque constant "
                "[N m/A] at the motor's shaft; add it"
            )
        if self.kt == 0 or self.gear == 0:
            raise ValueError(f"kt = {self.kt} and gear = {self.gear} must not be zero")
        return self

    @property
    def factor(self) -> float:
        """Torque at the joint per unit of the measured column."""
        return 1.0 if self.torque else float(self.kt or 0.0) * self.gear

    @property
    def measured(self) -> str:
        """Column that tells the torque."""
        return self.torque or self.current

    @property
    def per_command(self) -> float:
        """Torque at the joint per unit of the command."""
        return 1.0 if self.command_unit == "N m" else float(self.kt or 0.0) * self.gear


class Wire(Strict):
    """The [protocol] table: what a line looks like, and what the drive obeys."""

    columns: Annotated[list[str], Field(min_length=1)] = ["time", "command", "current"]
    unit: str = "us"
    wrap: float = 2.0**32
    checksum: str = "none"
    mark: str = ""
    separator: str = ","
    baud: Annotated[int, Field(gt=0)] = 115200
    begin: str = ""
    send: str = "u,{value}"
    stop: str = "stop"

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.send.count("{value}") != 1:
            raise ValueError(f'send = "{self.send}" must hold {{value}} once')
        self.format()
        return self

    def format(self) -> Format:
        """The lines' format."""
        names = ("unit", "wrap", "checksum", "mark", "separator")
        return Format(tuple(self.columns), **{name: getattr(self, name) for name in names})


@dataclass(frozen=True)
class Setup:
    """What the commands for a real rig need.

    motors : one for each driven joint; mechanism : the [mechanism] table, or None
    """

    motors: tuple[Motor, ...]
    wire: Wire
    mechanism: dict[str, Any] | None
    file: str

    def torque_columns(self) -> tuple[str, ...]:
        """Names of the torques in a log: "torque", or "torque_1" ... of several motors."""
        if len(self.motors) == 1:
            return (self.motors[0].torque or "torque",)
        return tuple(m.torque or f"torque_{k}" for k, m in enumerate(self.motors, start=1))


def setup_of(document: dict[str, Any], file: str) -> Setup:
    """Settings of a parsed rig.toml; `file` is its name in errors.

    Raises
    ------
    InputError
        Where constants are missing, or a value is not possible.

    Examples
    --------
    >>> setup_of({"motor": {"kt": 0.01, "gear": 18.0}}, "rig.toml").motors[0].factor.__round__(9)
    0.18
    >>> setup_of({}, "rig.toml")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: rig.toml: the table [motor] is missing; add it with kt [N m/A]
    and gear
    """
    for key in document:
        if isinstance(document[key], dict) and key not in TABLES:
            close = nearest(key, TABLES)
            if close.startswith("did") and key not in _OF_OTHERS:
                raise InputError(f"{file}: unknown table [{key}]; {close}")
    if "motor" not in document:
        raise InputError(f"{file}: the table [motor] is missing; add it with kt [N m/A] and gear")
    given = document["motor"]
    tables = given if isinstance(given, list) else [given]
    motors = tuple(_checked(Motor, t, f"{file}: [motor]") for t in tables)
    wire = _checked(Wire, document.get("protocol", {}), f"{file}: [protocol]")
    for motor in motors:
        for label in ("measured", "command"):
            name = getattr(motor, label)
            if name not in wire.columns and not (label == "command" and name in ("", "command")):
                raise InputError(
                    f"{file}: [motor] names the column {name!r}; [protocol] has "
                    f"{', '.join(wire.columns)}"
                )
    mechanism = document.get("mechanism")
    return Setup(motors, wire, mechanism if isinstance(mechanism, dict) else None, file)


_OF_OTHERS = ("friction", "camera", "drive", "recordings", "true_parameters", "angles", "marker")


def load_setup(path: str | Path) -> Setup:
    """Settings of the rig.toml at a path."""
    return setup_of(load_document(Path(path)), str(path))


def load_document(path: Path) -> dict[str, Any]:
    """Tables of a rig.toml."""
    if not path.is_file():
        raise InputError(f"{path} does not exist; name the rig.toml with --rig")
    try:
        return tomllib.loads(content_of(path).decode("utf-8"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is no TOML ({error}); correct it") from None


def _checked(model: Any, table: Any, where: str) -> Any:
    try:
        return model.model_validate(table)
    except ValidationError as invalid:
        raise InputError(f"{where}: {mistake(invalid)}") from None
