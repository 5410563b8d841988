"""Angles as they are read for an alignment, and aligned recordings as a data set."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import tomli_w
from pydantic import Field

from frictionid.config import Strict, checked
from frictionid.data.readers.dataset_toml import UNITS
from frictionid.data.readers.table import Table, content_of, read_table, table_name
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.files import write_text
from frictionid.mechanics import Mechanism

ORIGIN = "aligned by frictionid align"
_TIMES = ("time", "time_camera", "time_angle")
_DECIMALS = 9


class AngleColumns(Strict):
    """The [angles] table of rig.toml: which columns of a table of angles hold what.

    time : [s]; columns : one per joint; sigma : standard deviation of each; unit : of both
    """

    time: str = ""
    columns: Annotated[list[str], Field(min_length=1)] | None = None
    sigma: Annotated[list[str], Field(min_length=1)] | None = None
    unit: Literal["rad", "mrad", "deg", "rev", "m", "mm"] = "rad"


class Angles(NamedTuple):
    """Angles of a file, by the camera's clock, and another of its columns where one was asked.

    marker : of all frames, those without angles too
    """

    angle: Signal
    marker: Signal | None
    sha256: str


def read_angles(
    path: Path, settings: Mapping[str, Any], mechanism: Mechanism, marker: str = ""
) -> Angles:
    """Angles of all joints; rows without any angle (a lost dot, another clock) are left out.

    Raises
    ------
    InputError
        Where columns are missing, or times do not increase.
    """
    own = checked(AngleColumns, settings, "[angles]")
    content, file = content_of(path), str(path)
    header = content.partition(b"\n")[0].decode("utf-8", "replace").strip().split(",")
    time = own.time or next((t for t in _TIMES if t in header), _TIMES[0])
    names = own.columns or [f"q{j + 1}" for j in range(mechanism.n)]
    if len(names) != mechanism.n:
        raise InputError(
            f"[angles] columns = {names} must name one column for each of {mechanism.n} joints"
        )
    usual = [f"sigma{j + 1}" for j in range(mechanism.n)]  # as a tracker calls them
    sigma = own.sigma or (usual if set(usual) <= set(header) else [])
    if sigma and len(sigma) != mechanism.n:
        raise InputError(
            f"[angles] sigma = {sigma} must name one column for each of {mechanism.n} joints"
        )
    table = read_table(content, file, [time, *names, *sigma, *([marker] if marker else [])])
    seen = np.isfinite(np.stack([table.columns[n] for n in (time, *names)])).all(axis=0)
    if int(seen.sum()) < 10:
        raise InputError(
            f"{file} has {int(seen.sum())} rows with all of {', '.join((time, *names))}; "
            "an alignment needs some seconds of motion"
        )
    kept = table._replace(
        rows=table.rows[seen], columns={k: v[seen] for k, v in table.columns.items()}
    )
    angle = signal_of(kept, time, names, unit=UNITS["angle"][own.unit])
    if sigma:
        each = signal_of(kept, time, sigma, unit=UNITS["angle"][own.unit]).value
        angle = angle._replace(sigma=each)
    lamp = _column(table, time, marker) if marker else None
    return Angles(angle, lamp, hashlib.sha256(content).hexdigest())


def _column(table: Table, time: str, name: str) -> Signal:
    """A column of all rows that have one of a time."""
    there = np.isfinite(table.columns[time]) & np.isfinite(table.columns[name])
    if int(there.sum()) < 2:
        raise InputError(f"{table.file}: the column {name!r} is empty; name another --marker")
    own = {k: table.columns[k][there] for k in (time, name)}
    return signal_of(table._replace(rows=table.rows[there], columns=own), time, [name])


def check_place(folder: Path, name: str, head: Mapping[str, Any], replace: bool) -> None:
    """Complain now about what could not be written after the alignment.

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
    described = folder / "dataset.toml"
    if not described.exists():
        if folder.is_dir() and any(folder.glob("*.csv")):
            raise InputError(f"{folder} holds tables without a dataset.toml; name a new folder")
        return
    document = _document(described)
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
    if (folder / f"{name}.csv").exists() and not replace:
        raise InputError(f"{folder} has a recording {name!r}: choose another --name, or --replace")


def head_of(
    mechanism_table: Mapping[str, Any], driven: Sequence[bool], hold: str
) -> dict[str, Any]:
    """What all recordings of a data set must share in its dataset.toml."""
    joints = range(1, len(driven) + 1)
    return {
        "mechanism": dict(mechanism_table),
        "columns": {
            "time": {"angle": "time_camera", "torque": "time_drive"},
            "angle": [f"q{j}" for j in joints],
            "torque": [f"u{j}" if motor else "" for j, motor in zip(joints, driven, strict=True)],
        },
        "hold": {"torque": hold},
    }


def add_recording(
    folder: Path, name: str, head: Mapping[str, Any], angle: Signal, torque: Signal
) -> None:
    """Add a recording to a data set; torque (n columns) is on the angles' clock by now."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be made ({error.strerror}); name another --out"
        ) from None
    text = _table(head, angle, torque)
    described = folder / "dataset.toml"
    document = _document(described) if described.exists() else {}
    before = document.get("sha256", {})
    if document and ("sigma" in document["columns"]) != (angle.sigma is not None):
        raise InputError(
            f"{folder} has recordings {'without' if angle.sigma is not None else 'with'} standard "
            f"deviations of the angles, {name!r} is another kind; name a new folder with --out"
        )
    hashes = {**before, f"{name}.csv": hashlib.sha256(text.encode()).hexdigest()}
    if angle.sigma is not None:
        columns = {**head["columns"], "sigma": _deviations(head)}
        head = {**head, "columns": columns}
    document = {
        "name": re.sub(r"\W+", "_", folder.resolve().name) or "aligned",
        "origin": ORIGIN,
        **head,
        "recordings": {"patterns": sorted(hashes)},
        "sha256": dict(sorted(hashes.items())),
    }
    # in this order: a table that is not yet named in dataset.toml does no harm
    write_text(folder / f"{name}.csv", text)
    write_text(described, tomli_w.dumps(document))


def recording_name(path: Path) -> str:
    """Name of a recording after the file of its angles."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", table_name(path.name)) or "recording"


def _document(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(content_of(path).decode("utf-8"))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is no TOML ({error}); name a new folder with --out") from None


def _table(head: Mapping[str, Any], angle: Signal, torque: Signal) -> str:
    """CSV text: rows of the camera's clock, then those of the drive's."""
    motors = [j for j, column in enumerate(head["columns"]["torque"]) if column]
    angles = head["columns"]["angle"]
    each = [] if angle.sigma is None else _deviations(head)
    names = ["time_camera", *angles, *each, "time_drive", *(f"u{j + 1}" for j in motors)]
    lines = [",".join(names)]
    seen = angle.value if angle.sigma is None else np.hstack([angle.value, angle.sigma])
    for time, row in zip(angle.time, seen, strict=True):
        cells = [_cell(v) for v in (time, *row)]
        lines.append(",".join([*cells, *[""] * (1 + len(motors))]))
    for time, row in zip(torque.time, torque.value[:, motors], strict=True):
        cells = [_cell(v) for v in (time, *row)]
        lines.append(",".join([*[""] * (1 + len(angles) + len(each)), *cells]))
    return "\n".join(lines) + "\n"


def _deviations(head: Mapping[str, Any]) -> list[str]:
    """Columns of the standard deviations of the angles."""
    return [f"sigma{j + 1}" for j in range(len(head["columns"]["angle"]))]


def _cell(value: float) -> str:
    return f"{value:.{_DECIMALS}f}".rstrip("0").rstrip(".")
