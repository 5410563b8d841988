r"""Settings of a real rig in rig.toml: its motors, the protocol of their drive, its mechanism.

The protocol is that of lines; between bytes and rows there are pure functions. A line is

    [mark] value , value , ... [* checksum] newline

in ASCII, one value for each column, with \n or \r\n at its end. Other bytes between lines are
skipped. With a mark, a line is found even if the one before it lost its end.
"""

import binascii
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import PositiveInt, model_validator

from frictionid.config import NonEmpty, Positive, Strict, checked, nearest, read_toml
from frictionid.errors import InputError

# Hexadecimal digits of each checksum.
CHECKSUMS = {"none": 0, "xor": 2, "crc16": 4}
MAX_LINE = 1024  # bytes; longer lines are damaged
_CELL = re.compile(rb" *[+-]?(?:\d{1,24}(?:\.\d{0,24})?|\.\d{1,24})(?:[eE][+-]?\d{1,2})? *")
_EXAMPLE = 60  # bytes of a rejected line that are shown
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class LineProtocol(Strict):
    r"""The [protocol] table: format of a line, and the commands of the drive.

    Attributes
    ----------
    columns : names of the values, one of them "time"
    unit : of the time, "s", "ms" or "us"
    wrap : units after which the time wraps around to zero, 2^32 for a counter of 32 bits
    checksum : "none"; "xor" of all bytes between mark and asterisk, two hexadecimal digits; or
        "crc16", CCITT with the start value FFFF, four digits
    mark : one character that begins each line, or none
    separator : one character between values
    baud : rate of the port
    begin, stop : commands after which the drive reports and obeys, and no longer does
    send : command of torques, which stand in place of {value}

    Examples
    --------
    >>> line = written(LineProtocol(checksum="crc16", mark="$"), ("1000", "0.05", "0.2"))
    >>> line
    b'$1000,0.05,0.2*DBC5\n'
    >>> parsed(LineProtocol(checksum="crc16", mark="$"), b"", line)[0]
    [(b'1000', b'0.05', b'0.2')]
    """

    columns: NonEmpty[str] = ["time", "command", "current"]
    unit: Literal["s", "ms", "us"] = "us"
    wrap: Positive = 2.0**32
    checksum: Literal["none", "xor", "crc16"] = "none"
    mark: str = ""
    separator: str = ","
    baud: PositiveInt = 115200
    begin: str = ""
    send: str = "u,{value}"
    stop: str = "stop"

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.send.count("{value}") != 1:
            raise ValueError(f'send = "{self.send}" must hold {{value}} once')
        if "time" not in self.columns:
            raise ValueError(f"columns = {self.columns} have no 'time'; add it")
        for name in self.columns:
            if not _NAME.fullmatch(name) or name == "host":
                raise ValueError(f"columns: {name!r} is no name of letters, digits and _, or taken")
            if self.columns.count(name) > 1:
                raise ValueError(f"columns: {name!r} is named twice; each value has its own name")
        for key in ("mark", "separator"):
            text = getattr(self, key)
            fine = text.isascii() and text.isprintable() and text not in tuple("*+-.eE")
            if not fine or len(text) > 1 or text.isalnum() or (key == "separator" and not text):
                raise ValueError(f"{key} = {text!r} must be one character that no number has")
        if self.mark == self.separator:
            raise ValueError(f"mark and separator are both {self.mark!r}; choose another mark")
        return self


Cells = tuple[bytes, ...]


# A damaged line, and why: a wrong "checksum", number of "columns", or "garbage".
Rejected = tuple[bytes, str]


def parsed(
    form: LineProtocol, remainder: bytes, new: bytes
) -> tuple[list[Cells], list[Rejected], bytes]:
    r"""Rows of new bytes of a stream, after the `remainder` of those before.

    With rejected lines, and the begin of an unfinished one. The rows do not depend on how the
    stream is cut into pieces.

    >>> parsed(LineProtocol(), b"", b"1,2,3\n4,x,6\n7,8")[1:]
    ([(b'4,x,6', 'garbage')], b'7,8')
    """
    *lines, last = (remainder + new).split(b"\n")
    rows, rejected = [], []
    for line in lines:
        cells, fault = _cells(form, line)
        if not fault:
            rows.append(cells)
        elif line.strip():
            rejected.append((line[-MAX_LINE:], fault))
    return rows, rejected, last[-MAX_LINE - 2 :]


def _cells(form: LineProtocol, line: bytes) -> tuple[Cells, str]:
    """Values of a line as they were written, and why it is damaged, if it is; see `Rejected`."""
    body, fault = _unwrapped(form, line)
    cells = tuple(body.split(form.separator.encode()))
    if fault:
        return cells, fault
    numbers = all(map(_CELL.fullmatch, cells))
    if numbers and len(cells) != len(form.columns):
        return cells, "columns"
    return cells, "" if numbers and len(line) <= MAX_LINE else "garbage"


def written(form: LineProtocol, values: Sequence[str]) -> bytes:
    """Line of values, one for each column."""
    return framed(form, form.separator.join(values))


def framed(form: LineProtocol, text: str) -> bytes:
    """Line of any text with mark and checksum, such as a command to the drive."""
    body = text.encode("ascii")
    end = b"" if form.checksum == "none" else b"*" + checksum(form.checksum, body)
    return form.mark.encode() + body + end + b"\n"


def unframed(form: LineProtocol, line: bytes) -> str | None:
    """Text of a framed line, or None where it is damaged."""
    body, fault = _unwrapped(form, line)
    return None if fault or not body.isascii() else body.decode() or None


def checksum(kind: str, body: bytes) -> bytes:
    """Checksum of the bytes between mark and asterisk, as hexadecimal digits.

    >>> checksum("xor", b"1,2"), checksum("crc16", b"123456789")
    (b'2F', b'29B1')
    """
    if kind == "xor":
        return b"%02X" % reduce(xor, body, 0)
    return b"%04X" % binascii.crc_hqx(body, 0xFFFF)


def diagnosis(form: LineProtocol, rejected: Sequence[Rejected], count: int) -> str:
    """Message where no line can be read: the expected format, what came, and what to correct.

    count : bytes that came
    """
    shown = max((line for line, _ in rejected), key=_printable_share, default=b"")
    text = shown[:_EXAMPLE].decode("ascii", "backslashreplace").strip()
    if _printable_share(shown) < 0.9:
        return (
            f"nothing but garbage in {count} bytes: the baud rate is wrong, or something else is "
            "connected; check baud in [protocol], and the port"
        )
    kinds = Counter(reason for _, reason in rejected)
    kind = kinds.most_common(1)[0][0]
    wanted = form.separator.join(form.columns)
    rule = f"{form.mark}{wanted}{'' if form.checksum == 'none' else '*' + form.checksum}"
    hints = {
        "checksum": f"their checksums are not {form.checksum}: correct checksum in [protocol]",
        "columns": "their number of values is another: correct columns in [protocol]",
        "garbage": "correct [protocol], or what the drive sends",
    }
    return f"lines such as {text!r} do not follow the protocol {rule!r}; {hints[kind]}"


def _printable_share(line: bytes) -> float:
    """Share of printable characters."""
    plain = sum(32 <= b < 127 or b in b"\r\t" for b in line)
    return plain / len(line) if line else 0.0


def _unwrapped(form: LineProtocol, line: bytes) -> tuple[bytes, str]:
    """Bytes of a line between its last mark and its checksum, and what is wrong with these."""
    body = line.removesuffix(b"\r")
    if form.mark:
        _, mark, body = body.rpartition(form.mark.encode())
        body = body if mark else b""
    digits = CHECKSUMS[form.checksum]
    if not digits:
        return body, ""
    body, star, stated = body.rpartition(b"*")
    if not star or not re.fullmatch(rb"[0-9A-Fa-f]{%d}" % digits, stated):
        return body, "garbage"
    return body, "" if checksum(form.checksum, body) == stated.upper() else "checksum"


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
    tables : all tables of the rig.toml
    file : its name, for errors
    """

    motors: tuple[Motor, ...]
    protocol: LineProtocol
    tables: dict[str, Any]
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
    """All tables of a rig.toml."""
    if not path.is_file():
        raise InputError(f"{path} does not exist; name the rig.toml with --rig")
    document = read_toml(path)
    for key, table in document.items():  # tables of other names belong to others
        hint = nearest(key, _TABLES)
        if key not in _TABLES and isinstance(table, dict | list) and hint.startswith("did"):
            raise InputError(f"{path}: unknown table [{key}]; {hint}")
    return document


def rig_settings_of(document: dict[str, Any], file: str) -> RigSettings:
    """Settings of a parsed rig.toml; `file` is its name in errors.

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
    return RigSettings(motors, protocol, document, file)
