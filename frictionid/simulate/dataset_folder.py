"""A simulated data set as a folder: dataset.toml and one CSV table per recording."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from frictionid.config import read_toml
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Array
from frictionid.data.two_clock_table import (
    CAMERA,
    DRIVE,
    csv_text,
    decimal_cells,
    joint_columns,
    two_clock_csv,
)
from frictionid.errors import InputError
from frictionid.files import exchange, read_bytes
from frictionid.outputs import check_writable
from frictionid.simulate.simulation import COMMAND_DECIMALS, ORIGIN

# finer than the 1e-7 rad and rad/s to which noise-free data sets are exact
DECIMALS = 8
ROBOT_FILES = ("urdf", "mjcf")  # keys of a [mechanism] table that name a file


def write_dataset(
    dataset: Dataset, folder: str | Path, others: Mapping[str, bytes] | None = None
) -> None:
    """Write the folder of a simulated data set, as a whole or not at all.

    Parameters
    ----------
    dataset : Dataset, as `simulate` returns it
    folder : str or Path
        Created, or replaced where it holds nothing but a simulated data set.
    others : mapping of str to bytes, optional
        Other files of the folder by name, such as its rig.toml.

    Raises
    ------
    InputError
        Where the folder holds something else, or cannot be written.
    """
    target = Path(folder).resolve()
    _check_replaceable(target)
    files = {**(others or {}), **_files(dataset)}
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # next to the target: renaming is atomic only within one file system
        with _new_folder(target) as new:
            for name, content in files.items():
                (new / name).write_bytes(content)
            _swap(new, target)
    except OSError as error:
        raise InputError(
            f"{target} cannot be written ({error.strerror}); name another folder"
        ) from None


def _files(dataset: Dataset) -> dict[str, bytes]:
    """Content of each file by its name."""
    driven = dataset.mechanism.driven
    tables = {f"{r.name}.csv": _table(r, driven) for r in dataset.recordings}
    document = _document(dataset, driven)
    document["sha256"] = {name: hashlib.sha256(text).hexdigest() for name, text in tables.items()}
    document["truth"] = dict(dataset.truth or {})
    robot = _robot_file(document["mechanism"])
    return {**robot, **tables, "dataset.toml": tomli_w.dumps(document).encode()}


def _robot_file(table: dict[str, Any]) -> dict[str, bytes]:
    """The file that describes the mechanism, which the table then names without its folder."""
    for key in ROBOT_FILES:
        if key in table:
            path = Path(str(table[key]))
            table[key] = path.name
            return {path.name: read_bytes(path)}
    return {}


def _document(dataset: Dataset, driven: tuple[bool, ...]) -> dict[str, Any]:
    joints = range(1, len(driven) + 1)
    columns = joint_columns(driven)
    if _one_clock(dataset.recordings[0]):
        columns["time"] = "time"
    columns["truth"] = {
        "angle": [f"q{j}_true" for j in joints],
        "velocity": [f"w{j}_true" for j in joints],
    }
    if names := dataset.recordings[0].covariates:
        columns["covariates"] = {name: name for name in names}
    m = dataset.mechanism
    units = {"angle": m.position_units, "velocity": m.velocity_units, "torque": m.torque_units}
    return {
        "name": dataset.name,
        **dataset.origin,
        "mechanism": m.table,
        "columns": columns,
        **({"units": {k: list(v) for k, v in units.items()}} if "m" in m.position_units else {}),
        "recordings": {"patterns": ["*.csv"]},
    }


def _one_clock(recording: Recording) -> bool:
    return np.array_equal(recording.angle.time, recording.torque.time)


def _table(recording: Recording, driven: tuple[bool, ...]) -> bytes:
    """CSV text of a recording; with two clocks, the drive's rows follow those of the camera."""
    camera, drive = _columns(recording, driven)
    if not _one_clock(recording):
        return two_clock_csv(camera, drive).encode()
    columns = {"time": camera.pop(CAMERA), **camera, **drive}
    del columns[DRIVE]
    return csv_text(columns).encode()


def _columns(
    recording: Recording, driven: tuple[bool, ...]
) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Cells of the columns on the camera's and on the drive's clock."""
    camera = {CAMERA: _exact(recording.angle.time)}
    measured = [("q{}", recording.angle)]
    if recording.truth:
        measured += [("q{}_true", recording.truth.angle), ("w{}_true", recording.truth.velocity)]
    for name, signal in measured:
        for j, column in enumerate(signal.value.T, start=1):
            camera[name.format(j)] = decimal_cells(column, DECIMALS)
    for name, covariate in recording.covariates.items():
        camera[name] = decimal_cells(covariate.value[:, 0], DECIMALS)
    drive = {DRIVE: _exact(recording.torque.time)}
    for j in [j for j, motor in enumerate(driven) if motor]:
        drive[f"u{j + 1}"] = decimal_cells(recording.torque.value[:, j], COMMAND_DECIMALS)
    return camera, drive


def _exact(time: Array) -> list[str]:
    """Shortest texts of the exact numbers: even clocks stay even to the last bit."""
    return [repr(float(t)) for t in time]


def check_dataset_folder(folder: Path, *, replace: bool = False) -> None:
    """Check that a data set can and may be written here, before it is simulated.

    replace : whether it may take the place of an earlier simulated data set

    Raises
    ------
    InputError
        Where the folder holds a data set or something else, or cannot be written.
    """
    target = folder.resolve()
    check_writable(target)
    _check_replaceable(target)
    if not replace and (target / "dataset.toml").exists():
        raise InputError(
            f"{folder} holds a data set: name another folder, or --replace to simulate it anew"
        )


def _check_replaceable(target: Path) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f"{target} is a file; name a folder")
    foreign = {path.name for path in target.iterdir()} - {"rig.toml"} - _written(target)
    if foreign:
        raise InputError(
            f"{target} holds {min(foreign)!r}, which is no part of a simulated data set, or was "
            "changed; name a new or empty folder"
        )


def _written(folder: Path) -> set[str]:
    """Names of the files of an earlier `write_dataset` that are unchanged."""
    try:
        document = read_toml(folder / "dataset.toml")
    except InputError:
        return set()
    if document.get("origin") != ORIGIN:
        return set()
    paths = {name: folder / name for name in document.get("sha256", {})}
    same = {
        name
        for name, path in paths.items()
        if path.is_file()
        and hashlib.sha256(read_bytes(path)).hexdigest() == document["sha256"][name]
    }
    return {"dataset.toml"} | same


@contextlib.contextmanager
def _new_folder(target: Path) -> Iterator[Path]:
    """An empty folder next to the target, removed at the end."""
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as outer:
        new = Path(outer) / "new"
        new.mkdir()
        yield new


def _swap(new: Path, target: Path) -> None:
    """Replace the target by the new folder; its rig.toml stays where the new one has none."""
    if not target.exists():
        os.replace(new, target)
        return
    kept = target / "rig.toml"
    if kept.exists() and not (new / kept.name).exists():
        shutil.copy2(kept, new)
    if exchange(new, target):  # one of the two is there at any instant
        return
    old = target.with_name(f".{target.name}.old-{os.getpid()}")
    os.replace(target, old)
    try:
        os.replace(new, target)
    except OSError:
        os.replace(old, target)
        raise
    shutil.rmtree(old)
