"""Files of simulated rigs: their rig.toml, and the data set as a folder of tables."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
import tomli_w
from pydantic import TypeAdapter, ValidationError

from frictionid.config import nearest, place_of, read_toml
from frictionid.data.readers.csv_table import (
    CAMERA,
    DRIVE,
    csv_text,
    decimal_cells,
    joint_columns,
    two_clock_csv,
)
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Array
from frictionid.errors import InputError
from frictionid.files import read_bytes, sha256, write_bytes
from frictionid.outputs import check_writable, replace_files

from .rig import AnyFriction, Rig
from .simulation import COMMAND_DECIMALS
from .torques import AnyCommand

Settings = TypeVar("Settings")


def load_rig(path: str | Path) -> Rig:
    """Rig of a rig.toml."""
    document = read_toml(Path(path), "name a rig.toml")
    return rig_of(_beside(document, Path(path).parent), str(path))


def _beside(value: Any, folder: Path) -> Any:
    """A document whose files, of mechanisms and of torques, are those of a folder."""
    if isinstance(value, list):
        return [_beside(entry, folder) for entry in value]
    if not isinstance(value, dict):
        return value
    files = (*ROBOT_FILES, "file")
    return {k: str(folder / str(v)) if k in files else _beside(v, folder) for k, v in value.items()}


def rig_of(document: dict[str, Any], file: str) -> Rig:
    """Rig of a parsed rig.toml; `file` is its name in errors.

    Examples
    --------
    >>> rig_of({"nane": "demo"}, "rig.toml")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: rig.toml: unknown key 'nane'; did you mean 'name'?
    """
    return settings_of(Rig, document, file)


def settings_of(kind: type[Settings], document: dict[str, Any], file: str) -> Settings:
    """A dataclass of settings from a parsed TOML document; `file` is its name in errors."""
    for place, key, names in _unknown_keys(document, kind, ""):
        raise InputError(f"{file}: {place}unknown key {key!r}; {nearest(key, names)}")
    try:
        # as JSON: lists become tuples, tables dataclasses, and nothing else is converted
        text = json.dumps(document, default=str)
        return TypeAdapter(kind).validate_json(text, strict=True)
    except ValidationError as invalid:
        error = invalid.errors(include_url=False)[0]
        raise InputError(f"{file}: {_sentence(error)}") from None


def _sentence(error: Any) -> str:
    place = place_of(error, _KINDS).lstrip(".")
    if error["type"] == "missing":
        return f"the key {place!r} is missing; add it"
    reason = error["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    reason = reason.replace("an object", "a table").replace("a valid array", "a list")
    if error["type"] == "union_tag_not_found":
        reason = 'the key "kind" is missing; add it'
    elif error["type"] == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in error["ctx"]["expected_tags"].split(",")]
        reason = f"unknown kind {error['ctx']['tag']!r}; {nearest(str(error['ctx']['tag']), tags)}"
    elif error["type"] != "value_error":
        reason += f", not {error['input']!r:.60}"
    return f"{place}: {reason}" if place else reason


def _unknown_keys(value: Any, hint: Any, place: str) -> Iterator[tuple[str, str, list[str]]]:
    """Place, name and known names of each key that is no field of the dataclass of its table."""
    for i, entry in enumerate(value if isinstance(value, list) else ()):
        yield from _unknown_keys(entry, hint, f"{place}[{i}]")
    table = value if isinstance(value, dict) else {}
    kinds = (d for d in _dataclasses(hint) if _kind(d) in (None, table.get("kind")))
    for kind in islice(kinds, 1):  # of the table
        hints, names = get_type_hints(kind), [field.name for field in fields(kind)]
        for key, inner in table.items():
            if key in names:
                yield from _unknown_keys(inner, hints[key], f"{place}.{key}".lstrip("."))
            else:
                yield f"{place}: " if place else "", key, names


def _dataclasses(hint: Any) -> Iterator[Any]:
    if is_dataclass(hint):
        yield hint
    for part in get_args(hint):
        yield from _dataclasses(part)


def _kind(cls: Any) -> Any:
    return next((field.default for field in fields(cls) if field.name == "kind"), None)


_KINDS = set(map(_kind, _dataclasses(tuple[AnyFriction, AnyCommand])))


# finer than the 1e-7 rad and rad/s to which noise-free data sets are exact
DECIMALS = 8
ROBOT_FILES = ("urdf", "mjcf")  # keys of a [mechanism] table that name a file


def write_dataset(
    dataset: Dataset,
    folder: str | Path,
    others: Mapping[str, bytes] | None = None,
    *,
    replace: bool = False,
) -> None:
    """Write the folder of a simulated data set.

    Parameters
    ----------
    dataset : Dataset, as `simulate` returns it
    folder : str or Path
        Created; files of an earlier set are replaced, or removed.
    others : mapping of str to bytes, optional
        Other files of the folder by name, such as its rig.toml; they stay where a later set has
        none.
    replace : bool
        Whether files may be replaced that are not of an earlier set, or were changed.
    """
    for name, content in (others or {}).items():
        write_bytes(Path(folder) / name, content)
    # dataset.toml last: its hashes show a set that is not complete
    replace_files(Path(folder), _files(dataset), replace=replace)


def _files(dataset: Dataset) -> dict[str, bytes]:
    """Content of each file by its name."""
    tables = {f"{r.name}.csv": _table(r, dataset.mechanism.driven) for r in dataset.recordings}
    document = _document(dataset)
    document["sha256"] = {name: sha256(text) for name, text in tables.items()}
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


def _document(dataset: Dataset) -> dict[str, Any]:
    m = dataset.mechanism
    joints, columns = range(1, m.n + 1), joint_columns(m.driven)
    if _one_clock(dataset.recordings[0]):
        columns["time"] = "time"
    columns["truth"] = {
        "angle": [f"q{j}_true" for j in joints],
        "velocity": [f"w{j}_true" for j in joints],
    }
    if names := dataset.recordings[0].covariates:
        columns["covariates"] = {name: name for name in names}
    units = {"angle": m.position_units, "velocity": m.velocity_units, "torque": m.torque_units}
    return {
        "name": dataset.name,
        **dataset.origin,
        "mechanism": m.table,
        "columns": columns,
        **({"units": {k: list(v) for k, v in units.items()}} if "m" in m.position_units else {}),
        "recordings": {"patterns": [f"{r.name}.csv" for r in dataset.recordings]},
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
        Where the folder holds a data set, or cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder")
    check_writable(folder)
    if not replace and (folder / "dataset.toml").exists():
        raise InputError(
            f"{folder} holds a data set: name another folder, or --replace to simulate it anew"
        )
