"""Tables of numbers: CSV, gzipped CSV, Parquet and MAT, by column, with the rows of the file."""

import csv
import io
import re
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.data.readers.mat import mat_column, read_mat
from frictionid.data.readers.unpacking import check_cells, unzip
from frictionid.data.signals import Array
from frictionid.errors import InputError, needs

_RECORDER = "the reader drive_recorder (data/README.md)"
_NAMES = 20  # of columns, in a complaint
_HEADER = 1 << 20  # [bytes] of the line with the names of the columns
_LONG = 100_000  # [bytes] of a text that is worth trying to read at once
_ODD = (b'"', b"_", b"\r", b"\n\n")

SUFFIXES = (".csv", ".csv.gz", ".parquet", ".mat")
# Formats that only readers of their own understand.
OTHERS = (".json", ".json.gz", ".txt", ".txt.gz", ".mcap", ".db3")


class Table(NamedTuple):
    """Columns of numbers.

    Attributes
    ----------
    file : str
        Where they come from, for errors.
    rows : integer array, shape (R,)
        Row of the file for each entry; the header is row 1.
    columns : dict of str to array, shape (R,)
        In the unit of the file; nan where the cell is empty.
    """

    file: str
    rows: NDArray[np.int64]
    columns: dict[str, Array]


def read_table(content: bytes, file: str, columns: Sequence[str]) -> Table:
    r"""Table with the asked columns of a file's content.

    Parameters
    ----------
    content : bytes
    file : str
        Name of the file: its ending is the format; errors name it.
    columns : sequence of str

    Raises
    ------
    InputError
        Where the content is no such table, a column is missing or a cell is no number.

    Examples
    --------
    >>> read_table(b"time,q\n0.0,1.5\n0.1,\n", "a.csv", ["q"]).columns
    {'q': array([1.5, nan])}
    """
    lower = file.lower()
    if lower.endswith(".parquet"):
        table = _parquet(content, file, columns)
    elif lower.endswith(".mat"):
        table = _mat(content, file, columns)
    elif lower.endswith(".csv.gz"):
        table = _csv(unzip(content, file), file, columns)
    elif lower.endswith(".csv"):
        table = _csv(content, file, columns)
    else:
        raise InputError(f"{file}: tables end with {', '.join(SUFFIXES)}; narrow the patterns")
    if not len(table.rows):
        raise InputError(f"{file} has no rows below its header; record again or leave it out")
    return table


def numeric_table(content: bytes, file: str) -> Table:
    r"""Table with all columns of a CSV or Parquet file that hold numbers, in its order.

    Raises
    ------
    InputError
        Where the content is no such table, or two columns have one name.

    Examples
    --------
    >>> list(numeric_table(b"t,mode,q\n0.0,hold,1.5\n", "a.csv").columns)
    ['t', 'q']
    """
    if file.lower().endswith(".parquet"):
        picked = _numeric_parquet(content, file)
    else:
        picked = _numeric_csv(unzip(content, file), file)
    length = len(next(iter(picked.values()), ()))
    if not length:
        raise InputError(f"{file} has no rows of numbers below its header; name another table")
    return Table(file, np.arange(2, length + 2), picked)


def _numeric_parquet(content: bytes, file: str) -> dict[str, Array]:
    names = _parquet_names(content, file)
    _check_header(file, names, names)
    picked = {}
    for name in names:
        with suppress(InputError):  # columns of words
            picked[name] = _parquet(content, file, [name]).columns[name]
    return picked


def _numeric_csv(content: bytes, file: str) -> dict[str, Array]:
    """Columns of numbers of a CSV text, read row by row; words end those that hold any."""
    lines = _csv_lines(content, file)
    _, names = next(lines)
    _check_header(file, names, names)
    cells = {k: array("d") for k in range(len(names))}
    for row, line in lines:
        for k in list(cells):
            try:
                cells[k].append(_number(line[k], row, names[k], file))
            except InputError:
                del cells[k]
    return {names[k]: np.array(column) for k, column in cells.items()}


def table_name(file: str) -> str:
    """Name of a file without the ending of its format.

    Examples
    --------
    >>> table_name("day_1/07.csv.gz")
    'day_1/07'
    """
    for suffix in sorted(SUFFIXES + OTHERS, key=len, reverse=True):
        if file.lower().endswith(suffix):
            return file[: -len(suffix)]
    return file


def _csv(content: bytes, file: str, columns: Sequence[str]) -> Table:
    """Table of a CSV text, read row by row: a wrong row is refused before the next is read.

    Long texts of nothing but numbers are read at once, in a fifth of the time.
    """
    lines = _csv_lines(content, file)
    _, header = next(lines)
    _check_header(file, header, columns)
    places = [header.index(name) for name in columns]
    if (numbers := _numbers_alone(content, len(header))) is not None:
        whole = {name: numbers[:, at].copy() for name, at in zip(columns, places, strict=True)}
        return Table(file, np.arange(2, len(numbers) + 2), whole)
    rows, cells = array("q"), [array("d") for _ in columns]
    for row, line in lines:
        rows.append(row)
        for column, at, name in zip(cells, places, columns, strict=True):
            column.append(_number(line[at], row, name, file))
    picked = {name: np.array(column) for name, column in zip(columns, cells, strict=True)}
    return Table(file, np.array(rows, dtype=np.int64), picked)


def _numbers_alone(content: bytes, cells: int) -> Array | None:
    """All numbers (R, cells) of a long CSV text, or None where a row needs a closer look.

    That is where a cell is empty, quoted or no number, a line is blank, or rows differ in length.
    """
    if len(content) < _LONG or not content.isascii() or any(mark in content for mark in _ODD):
        return None
    separator = separator_of(content.partition(b"\n")[0].decode())
    try:
        text = io.StringIO(content.decode())
        numbers = np.loadtxt(text, delimiter=separator, comments=None, skiprows=1, ndmin=2)
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
        reader = csv.reader(text, strict=True, delimiter=separator)
        header = [cell.strip() for cell in next(reader, [])]
        yield reader.line_num, header
        expected = reader.line_num
        for cells in reader:
            expected += 1  # a blank line is no row, but it counts where rows are named
            _check_row(file, header, cells, (expected, reader.line_num))
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


def _check_row(file: str, header: list[str], cells: list[str], numbers: tuple[int, int]) -> None:
    """Complain about a row that ends in another line than expected, or has other cells."""
    expected, row = numbers
    if row != expected:
        # Two stray quotes would otherwise swallow all the rows between them.
        raise InputError(f"{file}, row {expected}: a quote is left open; delete it")
    if cells and len(cells) != len(header):
        raise InputError(
            f"{file}, row {row}: {len(cells)} cells under {len(header)} column names; "
            "repair or delete the row (decimal commas need semicolons between the cells; "
            f"lines above the names need {_RECORDER})"
        )


def _number(cell: str, row: int, name: str, file: str) -> float:
    """A cell as a number, nan where it is empty."""
    text = cell.strip()
    try:
        return number(text) if text else np.nan
    except ValueError:
        raise InputError(
            f"{file}, row {row}: column {name!r} holds {text[:40]!r}, which is no number; "
            "write a number, or leave the cell empty"
        ) from None


def _parquet_names(content: bytes, file: str) -> list[str]:
    with needs("parquet"):
        import pyarrow as pa
        import pyarrow.parquet as pq

    try:
        return list(pq.ParquetFile(io.BytesIO(content)).schema_arrow.names)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError(f"{file} is no whole Parquet file ({_first_line(error)})") from None


def _parquet(content: bytes, file: str, columns: Sequence[str]) -> Table:
    with needs("parquet"):
        import pyarrow as pa
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

    # What pyarrow raises at damaged files: its own errors, OSError, and ValueError at broken text.
    damage = (pa.ArrowException, OSError, ValueError)
    try:
        whole = pq.ParquetFile(io.BytesIO(content))
        header = list(whole.schema_arrow.names)
        places = {name: _place(name, header) for name in columns}
        bases = list(dict.fromkeys(base for base, _ in places.values()))
        _check_header(file, header, bases)
        check_cells(whole.metadata.num_rows, len(columns), file)
        table = whole.read(columns=bases)
    except InputError:
        raise
    except damage as error:
        raise InputError(f"{file} is no whole Parquet file ({_first_line(error)})") from None
    picked = {}
    for name in columns:
        try:
            base, element = places[name]
            cells = table.column(base)
            if element is not None:
                cells = pc.list_element(cells, element)
            cells = cells.cast(pa.float64(), safe=False)
        except damage as error:
            raise InputError(
                f"{file}: column {name!r} holds no numbers ({_first_line(error)})"
            ) from None
        picked[name] = cells.to_numpy().astype(float)
    # Rows are counted as in a CSV file: the first one below the header is row 2.
    return Table(file, np.arange(2, table.num_rows + 2), picked)


def _place(name: str, header: Sequence[str]) -> tuple[str, int | None]:
    """Column of a name, and the number of the element where it is one of a column of vectors.

    >>> _place("q[2]", ["t", "q"]), _place("q[2]", ["t", "q[2]"])
    (('q', 2), ('q[2]', None))
    """
    match = re.fullmatch(r"(.+)\[(\d{1,6})\]", name, re.ASCII)
    return (name, None) if name in header or match is None else (match[1], int(match[2]))


def _mat(content: bytes, file: str, columns: Sequence[str]) -> Table:
    variables = read_mat(content, file)
    picked = {name: mat_column(variables, name, file) for name in columns}
    lengths = {name: len(column) for name, column in picked.items()}
    if len(set(lengths.values())) > 1:
        sizes = ", ".join(f"{name!r} {length}" for name, length in lengths.items())
        raise InputError(f"{file}: the columns differ in length ({sizes}); export them alike")
    # MATLAB counts from 1, and there is no header.
    return Table(file, np.arange(1, next(iter(lengths.values()), 0) + 1), picked)


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)


def _check_header(file: str, header: Sequence[str], columns: Sequence[str]) -> None:
    if not any(header):
        raise InputError(f"{file} is empty; record again or leave it out")
    named = ", ".join(repr(name[:60]) for name in header[:_NAMES])
    named += f" and {len(header) - _NAMES} more" if len(header) > _NAMES else ""
    count = Counter(header)
    for name in columns:
        if count[name] == 0:
            raise InputError(f"{file} has no column {name!r}; it has {named}")
        if count[name] > 1:
            raise InputError(
                f"{file} has {count[name]} columns called {name!r}; rename them, or "
                f"count them by {_RECORDER}"
            )
