"""CSV texts of numbers, by column: read with the rows of the file, and written on two clocks."""

import csv
import io
import re
from array import array
from codecs import BOM_UTF16_LE
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frictionid.config import nearest
from frictionid.errors import InputError

from ..signals import Array

_RECORDER = "the reader drive_recorder (data/README.md)"
_REMEDY = 'write a number; of angles it may be empty, with missing = "drop" in [columns]'
_NAMES = 20  # of columns, in a complaint
_HEADER = 1 << 20  # [bytes] of the line with the names of the columns
_LONG = 100_000  # [bytes] of a text that is worth trying to read at once
_ODD = (b'"', b"_", b"\r", b"\n\n")


def csv_columns(
    content: bytes, file: str, columns: Sequence[str] | None, *, header: bool = True
) -> tuple[NDArray[np.int64], dict[str, Array], dict[str, str]]:
    """Numbers (R,) of the rows of a CSV text, and columns (R,): some, or all that hold numbers.

    Of columns that are left out, the third part says what they hold in place of a number. It is
    read row by row: a wrong row is refused before the next is read. Long texts of nothing but
    numbers are read at once, in a fifth of the time. Without a header, columns are called "1",
    "2", ...; where all are asked for, a first line of numbers is none.
    """
    content = _in_utf8(content)
    lines = _csv_lines(content, file)
    row, head = next(lines)
    if columns is None and any(head):
        header = not all(map(is_number, filter(None, head))) or _counts(head)
    if not header:
        lines, head = chain([(row, head)], lines), [str(k + 1) for k in range(len(head))]
    names = head if columns is None else columns
    check_header(file, head, names)
    places = {name: head.index(name) for name in names}
    if (numbers := _numbers_alone(content, len(head), header=header)) is not None:
        whole = {name: numbers[:, at].copy() for name, at in places.items()}
        return np.arange(len(numbers), dtype=np.int64) + 1 + header, whole, {}
    rows, cells = array("q"), {name: array("d") for name in places}
    faults = {}
    for row, line in lines:
        rows.append(row)
        for name in list(cells):
            try:
                cells[name].append(cell_number(line[places[name]], row, name, file))
            except InputError as error:
                if columns is not None:
                    raise
                faults[name] = str(error)
                del cells[name]
    picked = {name: np.array(column) for name, column in cells.items()}
    return np.array(rows, dtype=np.int64), picked, faults


def _in_utf8(content: bytes) -> bytes:
    """A text of Excel, in the code page of western Europe or in UTF-16, in UTF-8; others as is.

    >>> [_in_utf8("Winkel [°]".encode(code)).decode() for code in ("cp1252", "utf-16")]
    ['Winkel [°]', 'Winkel [°]']
    """
    wide = content.startswith(BOM_UTF16_LE)
    head = content.partition(b"\n")[0]
    if not wide and (content.isascii() or b"\0" in content or _is_utf8(head)):
        return content
    for code in ("utf-16",) if wide else ("utf-8", "cp1252"):
        with suppress(UnicodeDecodeError):
            return content.decode(code).encode()
    return content


def _is_utf8(text: bytes) -> bool:
    """Whether a text has letters beyond ASCII, and in UTF-8."""
    with suppress(UnicodeDecodeError):
        return not text.isascii() and bool(text.decode())
    return False


def _numbers_alone(content: bytes, cells: int, *, header: bool) -> Array | None:
    """All numbers (R, cells) of a long CSV text, or None where a row needs a closer look.

    That is where a cell is empty, quoted or no number, a line is blank, or rows differ in length.
    """
    names = content.partition(b"\n")[0]
    odd = any(content.find(mark, header * len(names)) >= 0 for mark in _ODD)
    if len(content) < _LONG or not content.isascii() or odd:
        return None
    try:
        text, separator = io.StringIO(content.decode()), separator_of(names.decode())
        numbers = np.loadtxt(
            text, delimiter=separator, comments=None, skiprows=int(header), ndmin=2
        )
    except ValueError:
        return None
    return numbers if numbers.shape[1] == cells else None


def _csv_lines(content: bytes, file: str) -> Iterator[tuple[int, list[str]]]:
    """The names of the columns, and the cells of each row that is not blank, with its number."""
    head = content[: _HEADER + 1].partition(b"\n")[0]
    if len(head) > _HEADER:
        raise InputError(f"{file} is no table: its first line is longer than {_HEADER} bytes")
    try:
        separator = separator_of(head.decode("utf-8-sig"))
        text = io.TextIOWrapper(io.BytesIO(content), "utf-8-sig", newline="")
        blank = separator == " "  # several separate cells as one does, and may end a line
        reader = csv.reader(text, strict=True, delimiter=separator, skipinitialspace=blank)
        header = [cell.strip() for cell in next(reader, [])]
        header = header[:-1] if blank and not header[-1] else header
        yield reader.line_num, header
        expected = reader.line_num
        for cells in reader:
            if blank and cells and not cells[-1]:
                cells.pop()
            expected += 1  # a blank line is no row, but it counts where rows are named
            if reader.line_num != expected:
                # Two stray quotes would otherwise swallow all the rows between them.
                raise InputError(f"{file}, row {expected}: a quote is left open; delete it")
            if cells and len(cells) != len(header):
                raise InputError(
                    f"{file}, row {expected}: {len(cells)} cells where the first line has "
                    f"{len(header)}; repair or delete the row (decimal commas need semicolons "
                    f"between the cells; lines above the names need {_RECORDER})"
                )
            if cells:
                yield reader.line_num, cells
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file} is no CSV text in UTF-8 ({error}); export it again") from None


def separator_of(header: str) -> str:
    r"""What separates the cells of a table, by its header: a comma, semicolon, tabulator or blank.

    >>> separator_of("time;q [rad];u, filtered"), separator_of("time,q"), separator_of("time q")
    (';', ',', ' ')
    """
    bare = re.sub('"[^"]*"', "", header)
    separator = max((",", ";", "\t"), key=bare.count)
    return separator if separator in bare or " " not in bare.strip() else " "


def number(text: str) -> float:
    """Number of a cell, with a decimal point or a decimal comma.

    Raises
    ------
    ValueError
        Where it is none, has both, or has other digits than 0 to 9.

    >>> number("-1.5e3"), number("0,25")
    (-1500.0, 0.25)
    """
    if "_" in text or not text.isascii():  # Python's own, and digits of other scripts
        raise ValueError(text)
    return float(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)


def is_number(text: str) -> bool:
    """Whether a cell is a number, see `number`."""
    try:
        number(text)
    except ValueError:
        return False
    return True


def _counts(head: Sequence[str]) -> bool:
    """Whether a first line of numbers counts the columns, as that of a frame without names does.

    >>> _counts(["", "0", "1", "2"]), _counts(["1", "2", "3"]), _counts(["0.0", "1", "2"])
    (True, True, False)
    """
    names = [name for name in head if name]
    return names in ([str(k + first) for k in range(len(names))] for first in (0, 1))


def cell_number(cell: str, row: int, name: str, file: str, remedy: str = _REMEDY) -> float:
    """A cell as a number, nan where it is empty; `remedy` where it is none."""
    text = cell.strip()
    try:
        return number(text) if text else np.nan
    except ValueError:
        remedy = "a table with a header needs header = true" if row == 1 else remedy
        remedy = "delete the row, which repeats the header" if text == name else remedy
        raise InputError(
            f"{file}, row {row}: column {name!r} holds {text[:40]!r}, which is no number; {remedy}"
        ) from None


def check_header(file: str, header: Sequence[str], columns: Sequence[str]) -> None:
    """Check that a table has each of some columns once."""
    if not any(header):
        raise InputError(f"{file} is empty; record again or leave it out")
    named = ", ".join(repr(name[:60]) for name in header[:_NAMES])
    named += f" and {len(header) - _NAMES} more" if len(header) > _NAMES else ""
    count = Counter(header)
    for name in columns:
        if count[name] == 0:
            close = nearest(name, header)
            meant = f"{close} It has" if close.startswith("did") else "it has"
            raise InputError(f"{file} has no column {name!r}; {meant} {named}")
        if count[name] > 1:
            raise InputError(
                f"{file} has {count[name]} columns called {name!r}; rename them, or "
                f"count them by {_RECORDER}"
            )


# --- Writing: rows of the camera's clock, then those of the drive's ------------------------------

CAMERA, DRIVE = "time_camera", "time_drive"


def joint_columns(driven: Sequence[bool]) -> dict[str, Any]:
    """The [columns] table for angles q1, ... and torques u1, ... of the driven joints.

    >>> joint_columns([False, True])["torque"]
    ['', 'u2']
    """
    joints = range(1, len(driven) + 1)
    return {
        "time": {"angle": CAMERA, "torque": DRIVE},
        "angle": [f"q{j}" for j in joints],
        "torque": [f"u{j}" if motor else "" for j, motor in zip(joints, driven, strict=True)],
    }


def two_clock_csv(camera: Mapping[str, list[str]], drive: Mapping[str, list[str]]) -> str:
    """CSV text of the columns of both clocks; cells on the other clock are empty.

    >>> two_clock_csv({"a": ["1"]}, {"b": ["2"]}).split()
    ['a,b', '1,', ',2']
    """
    seen, logged = (len(next(iter(columns.values()))) for columns in (camera, drive))
    columns = {name: cells + [""] * logged for name, cells in camera.items()}
    columns |= {name: [""] * seen + cells for name, cells in drive.items()}
    return csv_text(columns)


def csv_text(columns: Mapping[str, list[str]]) -> str:
    """CSV text of columns of equal length."""
    rows = [",".join(columns), *(",".join(cells) for cells in zip(*columns.values(), strict=True))]
    return "\n".join(rows) + "\n"


def decimal_cells(values: Array, decimals: int) -> list[str]:
    """Numbers with so many decimals at most.

    >>> decimal_cells(np.array([0.5, -1e-9]), 3)
    ['0.5', '0']
    """
    # + 0.0 turns -0.0 into 0.0
    return [f"{v:.{decimals}f}".rstrip("0").rstrip(".") for v in np.round(values, decimals) + 0.0]
