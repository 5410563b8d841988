"""Tables of numbers without a header line; their columns are called "1", "2", ..."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.data.readers.table import Table
from frictionid.data.readers.unpacking import unzip
from frictionid.errors import InputError


def read_headerless(content: bytes, file: str, columns: Sequence[str], comma: bool = True) -> Table:
    r"""Table with some columns of a text without a header, plain or gzipped.

    Parameters
    ----------
    content : bytes
    file : str
        Name of the file, for errors; gzipped where it ends with ".gz".
    columns : sequence of str
        Numbers of columns, from "1".
    comma : bool
        Whether commas or blanks separate the cells.

    Raises
    ------
    InputError
        Where the text is no such table, or a cell is no number. An empty cell is nan.

    Examples
    --------
    >>> read_headerless(b"1,2,3\n4,,6\n", "a.csv", ["3", "2"]).columns
    {'3': array([3., 6.]), '2': array([ 2., nan])}
    """
    try:
        text = unzip(content, file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{file} is no text in UTF-8 ({error}); export it again") from None
    lines = [(row, line) for row, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise InputError(f"{file} has no rows; record again or leave it out")
    separator = "," if comma else None
    width = len(lines[0][1].split(separator))
    for name in columns:
        if not (name.isdecimal() and 1 <= int(name) <= width):
            raise InputError(f"{file} has no column {name!r}; it has 1 to {width}")
    numbers = np.array([_cells(line.split(separator), width, file, row) for row, line in lines])
    picked = {name: numbers[:, int(name) - 1] for name in columns}
    return Table(file, np.array([row for row, _ in lines]), picked)


def _cells(cells: list[str], width: int, file: str, row: int) -> list[float]:
    if len(cells) != width:
        raise InputError(
            f"{file}, row {row}: {len(cells)} cells where the first row has {width}; "
            "repair or delete the row"
        )
    try:
        return [float(cell) if cell.strip() else np.nan for cell in cells]
    except ValueError as error:
        raise InputError(
            f"{file}, row {row}: {str(error)[:80]}; a table with a header needs header = true"
        ) from None
