"""Tables of numbers: CSV, Parquet, MAT, NumPy ..., by column, with the rows of the file."""

import csv
import io
import re
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.errors import InputError, needs
from frictionid.files import BAGS, TABLES, check_cells, most_bytes, unzip

from ..signals import Array, Signal, first_fault
from .csv_table import check_header, csv_columns
from .mat import mat_column, mat_names, of_usual_length, read_mat

# Formats that only readers of their own understand.
OTHERS = (".json", ".json.gz", ".txt", ".txt.gz", *BAGS)
_NAMED = 5  # rows of a fault, at most
_RATE = re.compile(r"(\d+\.?\d*|\.\d+) ?Hz")  # of rows without a time, in place of its column


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
    faults : dict of str to str
        Of columns that are left out, where they hold no number, in words.
    """

    file: str
    rows: NDArray[np.int64]
    columns: dict[str, Array]
    faults: Mapping[str, str] = {}

    def taken(self, keep: Any) -> "Table":
        """The rows of a mask (R,)."""
        columns = {name: column[keep] for name, column in self.columns.items()}
        return Table(self.file, self.rows[keep], columns)

    def complete(self, names: Sequence[str]) -> "Table":
        """The rows that have all of some columns."""
        cells = np.stack([self.columns[name] for name in names])
        return self.taken(~np.isnan(cells).any(axis=0))

    def split(self, name: str, clock: str) -> "list[Table]":
        """Tables of the runs: a new one begins where a column changes, or a clock falls back.

        name : of the column; clock : that of the time
        """
        step = np.diff(self.columns[name])
        begins = np.flatnonzero(step < 0 if name == clock else np.abs(step) > 0) + 1
        return [self.taken(part) for part in np.split(np.arange(len(self.rows)), begins)]


def read_table(content: bytes, file: str, columns: Sequence[str], *, header: bool = True) -> Table:
    r"""Table with the asked columns of a file's content.

    Parameters
    ----------
    content : bytes
    file : str
        Name of the file: its ending is the format, of texts without a header any; errors name it.
    columns : sequence of str
        A rate, "100 Hz", is the time [s] of rows that far apart.
    header : bool
        Whether a text has a line with the columns' names; else they are "1", "2", ...

    Raises
    ------
    InputError
        Where the content is no such table, a column is missing or a cell is no number.

    Examples
    --------
    >>> read_table(b"time,q\n0.0,1.5\n0.1,\n", "a.csv", ["q"]).columns
    {'q': array([1.5, nan])}
    >>> read_table(b"1,2,3\n4,,6\n", "a.csv", ["3", "2"], header=False).columns
    {'3': array([3., 6.]), '2': array([ 2., nan])}
    """
    if header and not file.lower().endswith(TABLES):
        raise InputError(f"{file}: tables end with {', '.join(TABLES)}; narrow the patterns")
    written = [name for name in columns if rate_of(name) is None]
    table = _table(content, file, written, header=header)
    if not len(table.rows):
        raise InputError(f"{file} has no rows below its header; record again or leave it out")
    return with_times(table, columns)


def rate_of(name: str) -> float | None:
    """Rate [Hz] of rows that stands in place of a column of times; None where none does.

    >>> rate_of("12.5 Hz"), rate_of("time")
    (12.5, None)
    """
    match = _RATE.fullmatch(name)
    return (float(match[1]) or None) if match else None


def with_times(table: Table, names: Sequence[str]) -> Table:
    """The table with times [s] of its rows as columns, where names are rates.

    >>> with_times(Table("a.csv", np.arange(2, 5), {}), ["q", "50 Hz"]).columns
    {'50 Hz': array([0.  , 0.02, 0.04])}
    """
    rows = np.arange(len(table.rows))
    times = {name: rows / rate for name in names if (rate := rate_of(name))}
    return table._replace(columns=table.columns | times)


def numeric_table(content: bytes, file: str) -> Table:
    r"""Table with all columns of a file that hold numbers, in its order.

    Where the first line of a text holds numbers, it is row 1, and the columns are "1", "2", ...

    Raises
    ------
    InputError
        Where the content is no such table, or two columns have one name.

    Examples
    --------
    >>> list(numeric_table(b"t,mode,q\n0.0,hold,1.5\n", "a.csv").columns)
    ['t', 'q']
    """
    table = _table(content, file, None)
    if not len(table.rows) or not table.columns:
        none = f"{file} has no rows of numbers below its header; name another table"
        raise InputError([none, *table.faults.values()][-1])
    return table


def _table(
    content: bytes, file: str, columns: Sequence[str] | None, *, header: bool = True
) -> Table:
    """Table of some columns, or of all that hold numbers."""
    for end, read in ((".parquet", _parquet), (".mat", _mat), (".npz", _npz)):
        if file.lower().endswith(end):
            return read(content, file, columns)
    return Table(file, *csv_columns(_csv(content, file), file, columns, header=header))


def _check_archive(content: bytes, file: str) -> None:
    """Check that a zip archive unpacks to no more than a recording has."""
    with zipfile.ZipFile(io.BytesIO(content)) as parts:
        size = sum(part.file_size for part in parts.infolist())
    if size > most_bytes(len(content)):
        raise InputError(f"{file} unpacks to {size / 1e6:.0f} MB: save it as CSV")


def _csv(content: bytes, file: str) -> bytes:
    """CSV text of a file, unzipped, or of the first sheet of an Excel file."""
    if not file.lower().endswith(".xlsx"):
        return unzip(content, file)
    with needs("excel"):
        import openpyxl
    if not content:
        raise InputError(f"{file} is empty; record again or leave it out")
    try:
        _check_archive(content, file)
        book = openpyxl.load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        lines = list(book.worksheets[0].iter_rows(values_only=True))
    except InputError:
        raise
    except Exception as error:  # of zip, XML, or openpyxl's own
        raise InputError(f"{file} is no whole Excel file ({_first_line(error)})") from None
    text = io.StringIO()
    # a row without a cell is a blank line, which counts where rows are named
    full = (line if any(cell is not None for cell in line) else () for line in lines)
    csv.writer(text, lineterminator="\n").writerows(full)
    return text.getvalue().encode()


def table_name(file: str) -> str:
    """Name of a file without the ending of its format.

    Examples
    --------
    >>> table_name("day_1/07.csv.gz")
    'day_1/07'
    """
    for suffix in sorted(TABLES + OTHERS, key=len, reverse=True):
        if file.lower().endswith(suffix):
            return file[: -len(suffix)]
    return file


def signal_of(
    table: Table,
    clock: str,
    names: Sequence[str],
    *,
    second: float = 1.0,
    unit: float | Array = 1.0,
    hold: str | None = None,
    sparse: bool = False,
    sigma: Array | None = None,
) -> Signal:
    """Named columns of a table as one signal; "" stands for a column of zeros.

    Parameters
    ----------
    table : Table
    clock : str
        The time column.
    names : sequence of n str
    second : float
        SI value of one unit of the clock.
    unit : float, or array, shape (n,)
        SI value of one unit of the columns, negative where their sign is the other way round.
    hold : "linear", "previous", or None where nothing is stated
    sparse : bool
        Whether only the rows with a time on this clock belong to the signal.
    sigma : array, shape (n,), or None, in the unit of the columns

    Raises
    ------
    InputError
        At the first row whose time does not increase or where a cell is empty or not finite.
    """
    time, rows = table.columns[clock], table.rows
    value = np.column_stack([table.columns[n] if n else np.zeros(len(time)) for n in names])
    if sparse:
        has_time = ~np.isnan(time)
        time, value, rows = time[has_time], value[has_time], rows[has_time]
    if not len(time):
        raise InputError(f"{table.file}: the column {clock!r} is empty; name the column of a clock")
    fault = first_fault(time, value, (clock, *names))
    if fault:
        at, reason = fault
        way = "repair or delete it"
        back = rows[1:][time[1:] <= np.fmax.accumulate(time)[:-1]]
        if "must increase" in reason and len(back) > 1:
            listed = ", ".join(map(str, back[:_NAMED])) + ", ..." * (len(back) > _NAMED)
            reason += f" ({len(back)} such rows: {listed})"
            way = "delete them all, or write times with more digits"
        if at and time[at] < time[at - 1]:
            way += f"; where another run begins there, say split = {clock!r}"
        if "empty" in reason:
            way += ' (a gap); empty angles are gaps with missing = "drop" in [columns]'
        raise InputError(f"{table.file}, row {rows[at]}: {reason}; {way}")
    # A number too large for its unit becomes infinite, which the recording refuses.
    with np.errstate(over="ignore"):
        deviation = None if sigma is None else sigma * np.abs(unit)
        return Signal(time * second, value * unit, hold, deviation)


def _parquet(content: bytes, file: str, columns: Sequence[str] | None) -> Table:
    """Table of some columns, or of all that hold numbers."""
    with needs("parquet"):
        import pyarrow as pa
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

    vectors = (pa.ListType, pa.LargeListType, pa.FixedSizeListType)
    # What pyarrow raises at damaged files: its own errors, OSError, and ValueError at broken text.
    damage = (pa.ArrowException, OSError, ValueError)
    try:
        whole = pq.ParquetFile(io.BytesIO(content))
        header = list(whole.schema_arrow.names)
        names = header if columns is None else columns
        bases = list(dict.fromkeys(_place(name, header)[0] for name in names))
        check_header(file, header, bases)
        check_cells(whole.metadata.num_rows, len(columns or [""]), file)
        table = whole.read(columns=bases)
        if columns is None:  # with each element of a vector
            lists = {n: table.column(n) for n in header if isinstance(table.field(n).type, vectors)}
            sizes = {n: pc.max(pc.list_value_length(cells)).as_py() for n, cells in lists.items()}
            names = [
                name if sizes.get(name) is None else f"{name}[{i}]"
                for name in header
                for i in range(sizes.get(name) or 1)
            ]
            check_cells(table.num_rows, len(names), file)
    except InputError:
        raise
    except damage as error:
        raise InputError(f"{file} is no whole Parquet file ({_first_line(error)})") from None
    picked = {}
    for name in names:
        base, element = _place(name, header)
        try:
            cells = table.column(base)
            if element is not None:
                cells = pc.list_element(cells, element)
            picked[name] = cells.cast(pa.float64(), safe=False).to_numpy().astype(float)
        except damage as error:
            if columns is not None:
                raise InputError(
                    f"{file}: column {name!r} holds no numbers ({_first_line(error)})"
                ) from None
    # Rows are counted as in a CSV file: the first one below the header is row 2.
    return Table(file, np.arange(2, table.num_rows + 2), picked)


def _place(name: str, header: Sequence[str]) -> tuple[str, int | None]:
    """Column of a name, and the number of the element where it is one of a column of vectors.

    >>> _place("q[2]", ["t", "q"]), _place("q[2]", ["t", "q[2]"])
    (('q', 2), ('q[2]', None))
    """
    match = re.fullmatch(r"(.+)\[(\d{1,6})\]", name, re.ASCII)
    return (name, None) if name in header or match is None else (match[1], int(match[2]))


def _mat(content: bytes, file: str, columns: Sequence[str] | None) -> Table:
    """Table of some columns, or of all that hold numbers."""
    variables = read_mat(content, file)
    names = mat_names(variables) if columns is None else columns
    if variables and not names:
        held = ", ".join(variables)
        raise InputError(f"{file}: {held} holds no numbers; save arrays in place of cells, objects")
    return _of_arrays({name: mat_column(variables, name, file) for name in names}, file)


def _npz(content: bytes, file: str, columns: Sequence[str] | None) -> Table:
    """Table of some columns, or of all as long as most are; those of a matrix q are q[0], q[1]."""
    try:
        _check_archive(content, file)
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: np.asarray(archive[name]) for name in archive}
    except InputError:
        raise
    except Exception as error:  # of zip, zlib, or the headers of arrays
        raise InputError(f"{file} is no whole NumPy archive ({_first_line(error)})") from None
    each: dict[str, Array] = {}
    for name, array in arrays.items():
        if array.dtype.kind in "fiu" and array.ndim == 1:
            each[name] = array.astype(float)
        elif array.dtype.kind in "fiu" and array.ndim == 2:
            each |= {f"{name}[{i}]": column.astype(float) for i, column in enumerate(array.T)}
    if columns is None:
        columns = of_usual_length({name: len(column) for name, column in each.items()})
    check_header(file, list(each), columns)
    return _of_arrays({name: each[name] for name in columns}, file)


def _of_arrays(picked: dict[str, Array], file: str) -> Table:
    """Table of columns of one length, whose rows count from 1, as there is no header."""
    lengths = {name: len(column) for name, column in picked.items()}
    if len(set(lengths.values())) > 1:
        sizes = ", ".join(f"{name!r} {length}" for name, length in lengths.items())
        raise InputError(f"{file}: the columns differ in length ({sizes}); export them alike")
    return Table(file, np.arange(1, next(iter(lengths.values()), 0) + 1), picked)


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)
