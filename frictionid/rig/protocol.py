r"""The line protocol of a motor drive: pure functions between bytes and rows.

A line is

    [mark] value , value , ... [* checksum] newline

in ASCII, one value for each column, with \n or \r\n at its end. Other bytes between lines are
skipped. With a mark, a line is found even if the one before it lost its end.
"""

from __future__ import annotations

import binascii
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from operator import xor
from typing import NamedTuple

from frictionid.errors import InputError

# SI value of a unit of the controller's clock.
SECOND = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
CHECKSUMS = ("none", "xor", "crc16")
MAX_LINE = 1024  # bytes; longer lines are damaged
_NUMBER = rb"[+-]?(?:\d{1,24}(?:\.\d{0,24})?|\.\d{1,24})(?:[eE][+-]?\d{1,2})?"
_EXAMPLE = 60  # bytes of a rejected line that are shown
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Format:
    r"""Format of a line.

    Attributes
    ----------
    columns : names of the values, one of them "time"
    unit : of the time, "s", "ms" or "us"
    wrap : units after which the time wraps around to zero, 2^32 for a counter of 32 bits
    checksum : "none"; "xor" of all bytes between mark and asterisk, two hexadecimal digits; or
        "crc16", CCITT with the start value FFFF, four digits
    mark : one character that begins each line, or none
    separator : one character between values

    Raises
    ------
    InputError
        For repeated names, no time, and marks or separators that numbers contain.

    Examples
    --------
    >>> line = written(Format(checksum="crc16", mark="$"), ("1000", "0.05", "0.2"))
    >>> line
    b'$1000,0.05,0.2*DBC5\n'
    >>> read(Format(checksum="crc16", mark="$"), line.rstrip())
    (b'1000', b'0.05', b'0.2')
    """

    columns: tuple[str, ...] = ("time", "command", "current")
    unit: str = "us"
    wrap: float = 2.0**32
    checksum: str = "none"
    mark: str = ""
    separator: str = ","

    def __post_init__(self) -> None:
        if "time" not in self.columns:
            raise InputError(f"columns = {list(self.columns)} have no 'time'; add it")
        for name in self.columns:
            if not _NAME.fullmatch(name) or name == "host":
                raise InputError(f"columns: {name!r} is no name of letters, digits and _, or taken")
            if self.columns.count(name) > 1:
                raise InputError(f"columns: {name!r} is named twice; each value has its own name")
        for label, value, values in (
            ("unit", self.unit, SECOND),
            ("checksum", self.checksum, CHECKSUMS),
        ):
            if value not in values:
                raise InputError(f"{label} = {value!r} is unknown; known: {', '.join(values)}")
        for label, text in (("mark", self.mark), ("separator", self.separator)):
            fine = text.isascii() and text.isprintable() and text not in tuple("*+-.eE")
            if not fine or len(text) > 1 or text.isalnum() or (label == "separator" and not text):
                raise InputError(f"{label} = {text!r} must be one character that no number has")
        if self.mark == self.separator:
            raise InputError(f"mark and separator are both {self.mark!r}; choose another mark")
        if not self.wrap > 0:
            raise InputError(f"wrap = {self.wrap} must be positive")


Cells = tuple[bytes, ...]


class Rejected(NamedTuple):
    """A damaged line, and the reason: "checksum", "columns" or "garbage"."""

    line: bytes
    reason: str


class Parsed(NamedTuple):
    """Content of some bytes: rows, rejected lines, and the begin of an unfinished line."""

    rows: list[Cells]
    rejected: list[Rejected]
    remainder: bytes


def parsed(form: Format, remainder: bytes, new: bytes) -> Parsed:
    r"""Rows of new bytes of a stream, after the `remainder` of those before.

    The rows do not depend on how the stream is cut into pieces.

    >>> parsed(Format(), b"", b"1,2,3\n4,x,6\n7,8").rejected
    [Rejected(line=b'4,x,6', reason='garbage')]
    """
    *lines, last = (remainder + new).split(b"\n")
    rows, rejected = [], []
    for line in lines:
        cells = read(form, line)
        if cells is not None:
            rows.append(cells)
        elif line.strip():
            rejected.append(Rejected(line[-MAX_LINE:], rejection_reason(form, line)))
    return Parsed(rows, rejected, last[-MAX_LINE - 2 :])


def read(form: Format, line: bytes) -> Cells | None:
    """Values of a line as they were written, or None where it is damaged."""
    line = _candidate(form, line)
    match = _pattern(form).fullmatch(line) if len(line) <= MAX_LINE else None
    if match is None:
        return None
    if form.checksum == "none":
        return tuple(line.split(form.separator.encode()))
    body, _, stated = line.rpartition(b"*")
    if checksum(form.checksum, body) != stated.upper():
        return None
    return tuple(body.split(form.separator.encode()))


def written(form: Format, values: Sequence[str]) -> bytes:
    """Line of values, one for each column."""
    return framed(form, form.separator.join(values))


def framed(form: Format, text: str) -> bytes:
    """Line of any text with mark and checksum, such as a command to the drive."""
    body = text.encode("ascii")
    end = b"" if form.checksum == "none" else b"*" + checksum(form.checksum, body)
    return form.mark.encode() + body + end + b"\n"


def unframed(form: Format, line: bytes) -> str | None:
    """Text of a framed line, or None where it is damaged."""
    body = _candidate(form, line)
    if form.checksum != "none":
        body, _, stated = body.rpartition(b"*")
        if checksum(form.checksum, body) != stated.upper():
            return None
    try:
        return body.decode("ascii") or None
    except UnicodeDecodeError:
        return None


def checksum(kind: str, body: bytes) -> bytes:
    """Checksum of the bytes between mark and asterisk, as hexadecimal digits.

    >>> checksum("xor", b"1,2"), checksum("crc16", b"123456789")
    (b'2F', b'29B1')
    """
    if kind == "xor":
        return b"%02X" % reduce(xor, body, 0)
    return b"%04X" % binascii.crc_hqx(body, 0xFFFF)


def rejection_reason(form: Format, line: bytes) -> str:
    """Why a line is damaged: wrong "checksum", wrong number of "columns", or "garbage"."""
    body = _candidate(form, line)
    if form.checksum != "none":
        body, star, stated = body.rpartition(b"*")
        digits = rb"[0-9A-Fa-f]{2}" if form.checksum == "xor" else rb"[0-9A-Fa-f]{4}"
        if not star or not re.fullmatch(digits, stated):
            return "garbage"
        if checksum(form.checksum, body) != stated.upper():
            return "checksum"
    cells = body.split(form.separator.encode())
    numbers = all(re.fullmatch(_NUMBER, cell) for cell in cells)
    return "columns" if numbers and len(cells) != len(form.columns) else "garbage"


def diagnosis(form: Format, rejected: Iterable[Rejected], count: int) -> str:
    """Message where no line can be read: the expected format, what came, and what to correct.

    count : bytes that came
    """
    lines = list(rejected)
    shown = max((r.line for r in lines), key=_printable_share, default=b"")
    text = shown[:_EXAMPLE].decode("ascii", "backslashreplace").strip()
    if _printable_share(shown) < 0.9:
        return (
            f"nothing but garbage in {count} bytes: the baud rate is wrong, or something else is "
            "connected; check --baud and the port"
        )
    kinds = Counter(r.reason for r in lines)
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


def _candidate(form: Format, line: bytes) -> bytes:
    """The part of a line behind its last mark, without a carriage return."""
    line = line.removesuffix(b"\r")
    if form.mark:
        _, mark, line = line.rpartition(form.mark.encode())
        return line if mark else b""
    return line


@lru_cache
def _pattern(form: Format) -> re.Pattern[bytes]:
    blank = rb" *"
    value = blank + _NUMBER + blank
    separator = re.escape(form.separator.encode())
    body = separator.join([value] * len(form.columns))
    ends = {"none": rb"", "xor": rb"\*[0-9A-Fa-f]{2}", "crc16": rb"\*[0-9A-Fa-f]{4}"}
    return re.compile(body + ends[form.checksum])
