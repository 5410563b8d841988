"""Angles of a table, by the camera's clock, as `frictionid align` reads them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from frictionid.config import Strict, checked
from frictionid.data.readers.dataset_toml import UNITS
from frictionid.data.readers.table import Table, read_table
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.files import read_bytes

_TIMES = ("time", "time_camera", "time_angle")
_MIN_ROWS = 10

Names = Annotated[list[str], Field(min_length=1)]


class AngleColumns(Strict):
    """The [angles] table of rig.toml: columns of a table of angles.

    time : [s]; columns : one per joint; sigma : standard deviation of each; unit : of both
    """

    time: str = ""
    columns: Names | None = None
    sigma: Names | None = None
    unit: Literal["rad", "mrad", "deg", "rev", "m", "mm"] = "rad"


class MeasuredAngles(NamedTuple):
    """Angles of a file, by the camera's clock.

    Attributes
    ----------
    angle : Signal, n columns
    marker : Signal of a sync LED in all rows, those without angles too, or None
    sha256 : of the file
    """

    angle: Signal
    marker: Signal | None
    sha256: str


def read_angles(
    path: Path, settings: Mapping[str, Any], joints: int, marker: str = ""
) -> MeasuredAngles:
    """Angles of all joints; rows without all of them (a lost dot, another clock) are left out.

    settings : the [angles] table; marker : column of a sync LED, or ""

    Raises
    ------
    InputError
        Where columns are missing, or times do not increase.
    """
    own = checked(AngleColumns, settings, "[angles]")
    content, file = read_bytes(path), str(path)
    header = content.partition(b"\n")[0].decode("utf-8", "replace").strip().split(",")
    time = own.time or next((t for t in _TIMES if t in header), _TIMES[0])
    usual = [f"sigma{j + 1}" for j in range(joints)]
    names = own.columns or [f"q{j + 1}" for j in range(joints)]
    sigma = own.sigma or (usual if set(usual) <= set(header) else [])
    for key, columns in (("columns", names), ("sigma", sigma)):
        if len(columns) != joints and (columns or key == "columns"):
            raise InputError(
                f"[angles] {key} = {columns} must name one column for each of {joints} joints"
            )
    table = read_table(content, file, [time, *names, *sigma, *([marker] if marker else [])])
    known = _rows(table, [time, *names])
    if len(known.rows) < _MIN_ROWS:
        raise InputError(
            f"{file} has {len(known.rows)} rows with all of {', '.join((time, *names))}; "
            "an alignment needs some seconds of motion"
        )
    unit = UNITS["angle"][own.unit]
    angle = signal_of(known, time, names, unit=unit)
    if sigma:
        angle = angle._replace(sigma=signal_of(known, time, sigma, unit=unit).value)
    led = _column(table, time, marker) if marker else None
    return MeasuredAngles(angle, led, hashlib.sha256(content).hexdigest())


def _rows(table: Table, names: list[str]) -> Table:
    """The rows that have numbers in all of some columns."""
    known = np.isfinite(np.stack([table.columns[name] for name in names])).all(axis=0)
    columns = {name: column[known] for name, column in table.columns.items()}
    return table._replace(rows=table.rows[known], columns=columns)


def _column(table: Table, time: str, name: str) -> Signal:
    """A column as a signal, in all rows that have it and a time."""
    known = _rows(table, [time, name])
    if len(known.rows) < 2:
        raise InputError(f"{table.file}: the column {name!r} is empty; name another --marker")
    return signal_of(known, time, [name])
