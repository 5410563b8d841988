"""Formats of recordings: one a file, whose name is that of the reader in dataset.toml.

A file has at least one of the functions

    read(path, settings)                      the recording in SI units, of a format that says all
    tables(content, file, settings, columns)  tables of the columns in [columns], each by what the
                                              name of its recording has behind that of the file

Beside `tables` there may be `unstated(columns)`, the quantities whose unit no name says, their
columns, and why it must be stated; and `defaults(document)`, the document of a dataset.toml with
what the format says of itself. Settings are the keys of [reader].
"""

from importlib import import_module
from pathlib import Path
from typing import Any

READERS = tuple(sorted(path.stem for path in Path(__file__).parent.glob("[!_]*.py")))


def part_of(kind: object, function: str) -> Any:
    """Function of the format of a name; None where it has none, or no format has the name.

    >>> part_of("rtde", "tables") is None, part_of("rtde", "read"), part_of("pdf", "read")
    (False, None, None)
    """
    return getattr(import_module(f"{__name__}.{kind}"), function, None) if kind in READERS else None
