"""Reader `drive_recorder`: CSV that drives' and controllers' recorders export.

Lines about the recording stand above the names of the columns and may stand below them; cells are
separated by tabulators, semicolons or commas, numbers may have decimal commas; each signal may have
a time column in front of it, all of one name, and a rate of its own [Scope]. Columns of one name
are counted: "Time", "Time[2]", ... Columns may be named by their objects [CiA402], such as 0x6064.
"""

import csv
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.config import Strict, checked
from frictionid.errors import InputError
from frictionid.files import unzip

from ..column_toml import ColumnNames
from ..csv_table import cell_number, is_number, separator_of
from ..table import Table

_HEAD, _BELOW = 200, 60  # lines that may stand above the names, and between these and the numbers
_NUMBERED = re.compile(r"\[\d+\]\Z")
_REMEDY = "repair or delete the row"
_SAME = 1e-9  # of the time, between two clocks that are one


def unstated(columns: ColumnNames) -> Iterator[tuple[str, str, str]]:
    """Quantities in columns that are objects, whose units a drive's settings say."""
    said = (
        ("angle", columns.angle, '"counts" (with counts_per_turn in [motor]) or what is set'),
        ("velocity", columns.velocity or [], '"counts/s", "rpm" or what is set in the drive'),
        ("torque", columns.torque, 'by CiA 402 "permille" of the motor\'s rated torque or current'),
    )
    for quantity, names, why in said:
        objects = [name for name in names if _object(name)]
        if objects:
            yield quantity, ", ".join(objects[:3]), why


def tables(
    content: bytes, file: str, settings: Mapping[str, Any], columns: ColumnNames
) -> dict[str, Table]:
    """Table of a recording, whose rows are those of the file from the first number on.

    Raises
    ------
    InputError
        Where no line names all columns, or one stands behind another clock than it is said to.
    """
    checked(Strict, settings, f"{file}: [reader]")
    lines = _text(unzip(content, file), file).splitlines()
    names = columns.names()
    head = _head(lines, names, file)
    clocks = _own_clocks(head, columns)
    places = {name: head.places[name] for name in names}
    places |= {f"{name}\0": place for name, place in clocks.items()}
    table = _rows(lines, head, places, [c for c in columns.clocks if c in places], file)
    for name, place in clocks.items():
        said = columns.clock_of(name)
        time, other = table.columns[said], table.columns[f"{name}\0"]
        if not np.allclose(time, other, rtol=_SAME, atol=0.0, equal_nan=True):
            raise InputError(
                f"{file}: {name!r} stands behind the time {head.cells[place][:60]!r}, which "
                f'differs from {said!r}: name it, as time = {{ angle = "...", torque = "..." }} in '
                "[columns], or as time in [actuator]"
            )
    return {"": table._replace(columns={name: table.columns[name] for name in names})}


class Head(NamedTuple):
    """Line with the names: its number from 0, separator, names, and places of the asked ones."""

    line: int
    separator: str
    cells: list[str]
    places: dict[str, int]


def _text(content: bytes, file: str) -> str:
    codes = ["utf-16"] if content[:2] in (b"\xff\xfe", b"\xfe\xff") else ["utf-8-sig", "cp1252"]
    for code in codes:
        try:
            return content.decode(code)
        except UnicodeDecodeError:
            continue
    raise InputError(f"{file} is no text; export it again as CSV in UTF-8")


def _cells(line: str, separator: str, where: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error as error:
        raise InputError(f"{where}: no row of a table ({error}); export it again") from None


def _head(lines: Sequence[str], names: Sequence[str], file: str) -> Head:
    """The first line that names all columns."""
    best: tuple[int, list[str], list[str]] = (0, [], list(names))
    for k, line in enumerate(lines[:_HEAD]):
        separator = separator_of(line)
        cells = _counted(_cells(line, separator, f"{file}, row {k + 1}"))
        places = {name: [at for at, c in enumerate(cells) if _is(c, name)] for name in names}
        missing = [name for name, at in places.items() if not at]
        twice = [name for name, at in places.items() if len(at) > 1]
        if not missing and twice:
            raise InputError(
                f"{file}, row {k + 1}: {len(places[twice[0]])} columns are {twice[0]!r}; name one "
                f"as it stands there, {cells[places[twice[0]][0]][:60]!r}"
            )
        if not missing:
            return Head(k, separator, cells, {name: at[0] for name, at in places.items()})
        if len(missing) < len(names) and (not best[1] or len(missing) < len(best[2])):
            best = (k, cells, missing)
    if not best[1]:
        raise InputError(f"{file}: none of its first {_HEAD} rows names a column {names[0]!r}")
    named = ", ".join(repr(cell[:60]) for cell in best[1][:20] if cell)
    raise InputError(f"{file}, row {best[0] + 1} has no column {best[2][0]!r}; it has {named}")


def _counted(cells: Sequence[str]) -> list[str]:
    """Names, the second of a name called "name[2]" and so on.

    >>> _counted(["Time", "q", "Time", "u"])
    ['Time', 'q', 'Time[2]', 'u']
    """
    seen: dict[str, int] = {}
    out = []
    for cell in cells:
        seen[cell] = seen.get(cell, 0) + 1
        out.append(cell if seen[cell] == 1 else f"{cell}[{seen[cell]}]")
    return out


def _object(name: str) -> str:
    """Index of the object in the profile area (6000 to 9FFF) that a name says, or "".

    >>> _object("0x6077"), _object("Axis 1 6064h:00 Position"), _object("16#606c"), _object("q6")
    ('6077', '6064', '606C', '')
    """
    match = re.search(r"(?:0x|16#)([6-9][0-9A-Fa-f]{3})\b|\b([6-9][0-9A-Fa-f]{3})h\b", name)
    return (match[1] or match[2]).upper() if match else ""


def _is(cell: str, name: str) -> bool:
    bare = _object(name) and not re.sub(r"0x|16#|h|[0-9A-Fa-f]{4}", "", name).strip()
    return cell == name or bool(bare and _object(cell) == _object(name))


def _base(name: str) -> str:
    return _NUMBERED.sub("", name)


def _own_clocks(head: Head, columns: ColumnNames) -> dict[str, int]:
    """Place of the time column in front of each signal that is not the one it is said to have."""
    clocks = columns.clocks
    times = [k for k, cell in enumerate(head.cells) if _base(cell) in map(_base, clocks)]
    out = {}
    for name, place in head.places.items():
        before = [k for k in times if k < place]
        if name not in clocks and before and head.cells[before[-1]] != columns.clock_of(name):
            out[name] = before[-1]
    return out


def _rows(
    lines: Sequence[str], head: Head, places: Mapping[str, int], clocks: Sequence[str], file: str
) -> Table:
    """Numbers at some places of all rows in which a clock has a time."""
    rows, picked = array("q"), {name: array("d") for name in places}
    width = max(places.values()) + 1
    for row, line in enumerate(lines[head.line + 1 :], head.line + 2):
        cells = _cells(line, head.separator, f"{file}, row {row}")
        if not any(cells):
            continue
        if cells[0] == "EOF" and not any(cells[1:]):
            break
        cells += [""] * (width - len(cells))
        times = [cells[places[clock]] for clock in clocks if cells[places[clock]]]
        if not rows and row - head.line <= _BELOW and not all(map(is_number, times)):
            continue  # units, scales and comments below the names
        if times:
            rows.append(row)
            for name, place in places.items():
                named = head.cells[place][:60]
                picked[name].append(cell_number(cells[place], row, named, file, _REMEDY))
    if not rows:
        raise InputError(f"{file} has no rows of numbers below its names; record it again")
    return Table(file, np.array(rows), {name: np.array(times) for name, times in picked.items()})
