"""Settings of a real rig in rig.toml: its motors, the protocol of their drive, its mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import model_validator

from frictionid.config import Positive, Strict, checked, nearest, read_toml
from frictionid.errors import InputError
from frictionid.rig.protocol import LineProtocol

# One rig.toml serves all commands: each reads its own tables of these.
_TABLES = ("mechanism", "motor", "protocol", "angles", "markers", "links", "camera", "sync_led")


class Motor(Strict):
    """A motor and the columns of its drive.

    Attributes
    ----------
    kt : torque constant [N m/A] at the shaft of the motor
    gear : turns of the motor for one of the joint, negative where they turn against each other
    current : column of the current [A]
    torque : column of the torque at the joint [N m], where the drive reports it
    command : column of the command, or "" where the drive reports none
    command_unit : of that column and of the commands sent: torque at the joint, or current
    limit : largest torque at the joint [N m]
    """

    kt: float | None = None
    gear: float = 1.0
    current: str = "current"
    torque: str = ""
    command: str = "command"
    command_unit: Literal["N m", "A"] = "N m"
    limit: Positive | None = None

    @model_validator(mode="after")
    def _constants(self) -> Self:
        if not self.torque and self.kt is None:
            raise ValueError(
                "the key 'kt' is missing: torque = kt gear current needs the torque constant "
                "[N m/A] at the motor's shaft; add it"
            )
        if self.kt == 0 or self.gear == 0:
            raise ValueError(f"kt = {self.kt} and gear = {self.gear} must not be zero")
        return self

    @property
    def measured(self) -> str:
        """Column of the measured current or torque."""
        return self.torque or self.current

    @property
    def per_measured(self) -> float:
        """Torque at the joint per unit of the measured column."""
        return 1.0 if self.torque else self._per_ampere

    @property
    def per_command(self) -> float:
        """Torque at the joint per unit of the command."""
        return 1.0 if self.command_unit == "N m" else self._per_ampere

    @property
    def _per_ampere(self) -> float:
        return float(self.kt or 0.0) * self.gear


@dataclass(frozen=True)
class RigSettings:
    """Settings of a real rig.

    Attributes
    ----------
    motors : one for each driven joint
    protocol : LineProtocol
    mechanism : the [mechanism] table, or None
    file : name of the rig.toml, for errors
    """

    motors: tuple[Motor, ...]
    protocol: LineProtocol
    mechanism: dict[str, Any] | None
    file: str

    def torque_columns(self) -> tuple[str, ...]:
        """Names of the torques in a log: "torque", or "torque_1" ... of several motors."""
        if len(self.motors) == 1:
            return (self.motors[0].torque or "torque",)
        return tuple(m.torque or f"torque_{k}" for k, m in enumerate(self.motors, start=1))


def load_rig_settings(path: str | Path) -> RigSettings:
    """Settings of the rig.toml at a path."""
    return rig_settings_of(rig_tables(Path(path)), str(path))


def rig_tables(path: Path) -> dict[str, Any]:
    """All tables of a rig.toml.

    Raises
    ------
    InputError
        Where the file is missing or no TOML, or a table is misspelt.
    """
    if not path.is_file():
        raise InputError(f"{path} does not exist; name the rig.toml with --rig")
    document = read_toml(path)
    _check_tables(document, str(path))
    return document


def _check_tables(document: dict[str, Any], file: str) -> None:
    """InputError for a misspelt table; tables of other names belong to others."""
    for key, table in document.items():
        hint = nearest(key, _TABLES)
        if key not in _TABLES and isinstance(table, dict | list) and hint.startswith("did"):
            raise InputError(f"{file}: unknown table [{key}]; {hint}")


def rig_settings_of(document: dict[str, Any], file: str) -> RigSettings:
    """Settings of a parsed rig.toml; `file` is its name in errors.

    Raises
    ------
    InputError
        Where constants are missing, or a value is not possible.

    Examples
    --------
    >>> rig_settings_of({"motor": {"kt": 0.01, "gear": 18.0}}, "rig.toml").motors[0].gear
    18.0
    >>> rig_settings_of({}, "rig.toml")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: rig.toml: the table [motor] is missing; add it with kt [N m/A]
    and gear
    """
    _check_tables(document, file)
    if "motor" not in document:
        raise InputError(f"{file}: the table [motor] is missing; add it with kt [N m/A] and gear")
    motor = document["motor"]
    tables = motor if isinstance(motor, list) else [motor]
    motors = tuple(checked(Motor, table, f"{file}: [motor]") for table in tables)
    protocol = checked(LineProtocol, document.get("protocol", {}), f"{file}: [protocol]")
    for motor in motors:
        optional = ("", "command")  # a drive need not report its commands
        columns = (motor.measured, *(() if motor.command in optional else (motor.command,)))
        for name in columns:
            if name not in protocol.columns:
                raise InputError(
                    f"{file}: [motor] names the column {name!r}; [protocol] has "
                    f"{', '.join(protocol.columns)}"
                )
    mechanism = document.get("mechanism")
    return RigSettings(motors, protocol, mechanism if isinstance(mechanism, dict) else None, file)
