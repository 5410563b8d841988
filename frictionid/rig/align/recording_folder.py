"""Tables of angles as `frictionid align` reads them, and aligned recordings as a data set."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import tomli_w
from pydantic import Field

from frictionid.config import Strict, checked, read_toml
from frictionid.data.readers.dataset_toml import UNITS
from frictionid.data.readers.table import Table, read_table, table_name
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.signals import Signal
from frictionid.data.two_clock_table import (
    CAMERA,
    DRIVE,
    decimal_cells,
    joint_columns,
    two_clock_csv,
)
from frictionid.errors import InputError
from frictionid.files import read_bytes, write_text
from frictionid.outputs import check_outputs

ORIGIN = "aligned by frictionid align"
_DECIMALS = 9


def head_of(
    mechanism_table: Mapping[str, Any], driven: Sequence[bool], hold: str
) -> dict[str, Any]:
    """Tables of dataset.toml that all recordings of a data set share."""
    return {
        "mechanism": dict(mechanism_table),
        "columns": joint_columns(driven),
        "hold": {"torque": hold},
    }


def check_place(folder: Path, name: str, head: Mapping[str, Any], replace: bool) -> None:
    """Check that a recording can be added, before anything is computed.

    Raises
    ------
    InputError
        Where the folder holds other data, or a recording of this name already.
    """
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise InputError(
            f"--name {name!r} must have letters, digits, - and _ only: it names a file"
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder with --out")
    if (folder / "dataset.toml").exists():
        _check_dataset(folder, head, replace)
    elif folder.is_dir() and any(folder.glob("*.csv")):
        raise InputError(f"{folder} holds tables without a dataset.toml; name a new folder")
    if (folder / f"{name}.csv").exists() and not replace:
        raise InputError(f"{folder} has a recording {name!r}: choose another --name, or --replace")
    endings = ("csv", "align.toml", "clock.png", "command.png")
    check_outputs([folder / f"{name}.{ending}" for ending in endings], replace=replace)


def _check_dataset(folder: Path, head: Mapping[str, Any], replace: bool) -> None:
    """Check that a data set is one of aligned recordings that another one fits into."""
    described = folder / "dataset.toml"
    document = read_toml(described)
    if document.get("origin") != ORIGIN:
        raise InputError(f"{folder} holds another data set; name a new folder with --out")
    for key, value in head.items():
        before = document.get(key)
        if isinstance(before, dict):  # deviations are checked when the angles have been read
            before = {k: v for k, v in before.items() if k != "sigma"}
        if before != value:
            raise InputError(
                f"{folder} has recordings with another [{key}]; name a new folder with --out"
            )
    if not replace and read_bytes(described) != tomli_w.dumps(document).encode():
        raise InputError(
            f"{described} was edited by hand, and comments are lost when a recording is added: "
            "name a new folder with --out, or --replace"
        )


def add_recording(
    folder: Path, name: str, head: Mapping[str, Any], angle: Signal, torque: Signal
) -> None:
    """Add a recording to a data set; torque (n columns) is on the angles' clock."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be made ({error.strerror}); name another --out"
        ) from None
    described = folder / "dataset.toml"
    document = read_toml(described) if described.exists() else {}
    if document and ("sigma" in document["columns"]) != (angle.sigma is not None):
        raise InputError(
            f"{folder} has recordings {'without' if angle.sigma is not None else 'with'} standard "
            f"deviations of the angles, {name!r} is another kind; name a new folder with --out"
        )
    text = _table(head, angle, torque)
    hashes = {
        **document.get("sha256", {}),
        f"{name}.csv": hashlib.sha256(text.encode()).hexdigest(),
    }
    columns = dict(head["columns"])
    if angle.sigma is not None:
        columns["sigma"] = _deviations(head)
    document = {
        **document,
        "name": document.get("name") or re.sub(r"\W+", "_", folder.resolve().name) or "aligned",
        "origin": ORIGIN,
        **head,
        "columns": columns,
        "recordings": {**document.get("recordings", {}), "patterns": sorted(hashes)},
        "sha256": dict(sorted(hashes.items())),
    }
    # in this order: a table that is not yet named in dataset.toml does no harm
    write_text(folder / f"{name}.csv", text)
    write_text(described, tomli_w.dumps(document))


def recording_name(path: Path) -> str:
    """Name of a recording after the file of its angles."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", table_name(path.name)) or "recording"


def _table(head: Mapping[str, Any], angle: Signal, torque: Signal) -> str:
    """CSV text: rows of the camera's clock, then those of the drive's."""
    camera = {CAMERA: angle.time, **dict(zip(head["columns"]["angle"], angle.value.T, strict=True))}
    if angle.sigma is not None:
        camera |= dict(zip(_deviations(head), angle.sigma.T, strict=True))
    drive = {DRIVE: torque.time}
    drive |= {u: torque.value[:, j] for j, u in enumerate(head["columns"]["torque"]) if u}
    return two_clock_csv(
        *(
            {name: decimal_cells(column, _DECIMALS) for name, column in columns.items()}
            for columns in (camera, drive)
        )
    )


def _deviations(head: Mapping[str, Any]) -> list[str]:
    """Columns of the standard deviations of the angles."""
    return [f"sigma{j + 1}" for j in range(len(head["columns"]["angle"]))]


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
