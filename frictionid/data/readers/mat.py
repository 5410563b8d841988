"""MAT files of versions 5 to 7: numbers, structures, and single columns by name.

The format is that of [MathWorks2024]: tagged elements, nested and padded to 8 bytes. SciPy's reader
is not used because damaged files can crash it together with the interpreter.
"""

import math
import re
import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from frictionid.errors import InputError
from frictionid.files import most_bytes

from ..signals import Array

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
# How an element's numbers are stored; MATLAB packs doubles that are small whole numbers.
_STORED = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_STRUCTURE, _OBJECT = 2, 17  # the object of a class, such as a time series: its content is MATLAB's
_NUMERIC = range(6, 16)
_COMPLEX = 0x800
_NAME = re.compile(r"([A-Za-z]\w*(?:\.[A-Za-z]\w*)*)(?:\(:,\s*([1-9]\d*)\))?")


def read_mat(content: bytes, file: str) -> dict[str, Any]:
    """Variables of a MAT file: arrays, structures as dicts, and None for other content.

    Raises
    ------
    InputError
        Where the content is no MAT file, or one of version 7.3, which is another format (HDF5).
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[_HEADER - 2 : _HEADER])
    if order is None:
        raise InputError(f"{file} is no whole MAT file of version 5 to 7; export it again")
    if struct.unpack_from(f"{order}H", content, _HEADER - 4)[0] != 0x0100:
        raise InputError(f"{file} is a MAT file of version 7.3; save it again with '-v7'")
    variables: dict[str, Any] = {}
    try:
        for kind, data in _elements(memoryview(content)[_HEADER:], order):
            if kind == _COMPRESSED:
                kind, data = next(_elements(_unpacked(data), order))
            if kind == _MATRIX and len(data):
                name, value = _variable(data, order)
                variables |= {name: value} if name else {}  # what classes keep has no name
    # the errors of damaged files
    except (ValueError, LookupError, StopIteration, struct.error, zlib.error, RecursionError):
        raise InputError(f"{file} is no whole MAT file; copy or export it again") from None
    return variables


def mat_column(variables: dict[str, Any], name: str, file: str) -> Array:
    """Column of the variables, shape (R,): "q", "data(:,2)", "log.q" or "log.q(:,2)".

    Raises
    ------
    InputError
        Where there is no such variable or column, or it holds no real numbers.

    Examples
    --------
    >>> mat_column({"log": {"q": np.array([[1.0, 5.0], [2.0, 6.0]])}}, "log.q(:,2)", "a.mat")
    array([5., 6.])
    """
    match = _NAME.fullmatch(name.strip())
    if match is None:
        raise InputError(f"{file}: {name!r} names no column; write q, data(:,2) or log.q(:,2)")
    value: Any = variables
    for part in match[1].split("."):
        if not isinstance(value, dict) or part not in value:
            fields = ", ".join(map(repr, value)) if isinstance(value, dict) else "no fields"
            raise InputError(f"{file} has no column {name!r}; it has {fields or 'nothing'}")
        value = value[part]
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu" or value.ndim > 2:
        raise InputError(f"{file}: column {name!r} holds no real numbers; convert it to double")
    if match[2] is not None:
        table = value if value.ndim == 2 else value[:, None]
        if int(match[2]) > table.shape[1]:
            raise InputError(f"{file}: there is no {name!r}, it has {table.shape[1]} columns")
        return table[:, int(match[2]) - 1].astype(float)
    if value.ndim == 2 and min(value.shape) > 1:
        raise InputError(
            f"{file}: {name!r} has {value.shape[1]} columns; name one of them, as {match[1]}(:,1)"
        )
    return value.ravel().astype(float)


def mat_names(variables: dict[str, Any]) -> list[str]:
    """Names of all columns of numbers that are as long as most numbers of the file are.

    Examples
    --------
    >>> log = {"q": np.zeros((9, 2)), "mass": np.ones((1, 1)), "wide": np.zeros((2, 99))}
    >>> mat_names({"t": np.zeros((9, 1)), "log": log, "table": np.ones((20, 1))})
    ['t', 'log.q(:,1)', 'log.q(:,2)']
    """
    return of_usual_length(dict(_sizes(variables)))


def of_usual_length(lengths: dict[str, int]) -> list[str]:
    """Names of columns that are as long as most numbers of a file are, by the length of each."""
    every = list(lengths.values())
    usual = max(every, key=lambda length: length * every.count(length), default=0)
    return [name for name, length in lengths.items() if length == usual]


def _sizes(variables: dict[str, Any], within: str = "") -> Iterator[tuple[str, int]]:
    """Name and length of each column of numbers."""
    for name, value in variables.items():
        if isinstance(value, dict):
            yield from _sizes(value, f"{within}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "fiu":
            rows, columns = value.shape
            if 1 in value.shape:
                yield within + name, value.size
            elif columns <= rows:  # a wide matrix has its samples side by side
                yield from ((f"{within}{name}(:,{k + 1})", rows) for k in range(columns))


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Type and data of each element; ValueError where one goes beyond the end."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        begin = at + 8
        if kind >> 16:  # up to 4 bytes stand within the tag
            size, kind, begin = kind >> 16, kind & 0xFFFF, at + 4
        if begin + size > (len(data) if begin > at + 4 else at + 8):
            raise ValueError("an element is cut off")
        yield kind, data[begin : begin + size]
        at = begin + size
        at += 0 if kind == _COMPRESSED else -at % 8


def _unpacked(data: memoryview) -> memoryview:
    stream = zlib.decompressobj()
    content = stream.decompress(data, most_bytes(len(data)))
    if stream.unconsumed_tail or not stream.eof:
        raise ValueError("a compressed variable is cut off")
    return memoryview(content)


def _variable(data: memoryview, order: str) -> tuple[str, Any]:
    """Name and value of a matrix element: array (as MATLAB shapes it), dict, or None."""
    parts = list(_elements(data, order))
    flags = int(np.frombuffer(parts[0][1], f"{order}u4")[0])
    if flags & 0xFF == _OBJECT:
        return bytes(parts[1][1]).decode("ascii"), None
    shape = tuple(int(size) for size in np.frombuffer(parts[1][1], f"{order}i4"))
    if len(shape) < 2 or min(shape) < 0:
        raise ValueError("a variable has no shape")
    name = bytes(parts[2][1]).decode("ascii")
    kind = flags & 0xFF
    if kind == _STRUCTURE and math.prod(shape) == 1:
        width = int(np.frombuffer(parts[3][1], f"{order}i4")[0])
        names = [bytes(parts[4][1][k : k + width]) for k in range(0, len(parts[4][1]), width)]
        fields = [_variable(field, order)[1] if len(field) else None for _, field in parts[5:]]
        keys = [key.partition(b"\0")[0].decode("ascii") for key in names]
        return name, dict(zip(keys, fields, strict=True))
    if kind not in _NUMERIC or flags & _COMPLEX:
        return name, None
    stored, numbers = parts[3]
    value = np.frombuffer(numbers, order + _STORED[stored])
    # data that do not fit the shape raise a ValueError
    return name, value.astype(value.dtype.newbyteorder("=")).reshape(shape, order="F")
