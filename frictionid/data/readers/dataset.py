"""Data sets: a dataset.toml and its tables, as checked recordings in SI units."""

import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.config import imported, nearest, read_toml, untrusted
from frictionid.errors import InputError
from frictionid.files import dataset_path, read_bytes, sha256
from frictionid.mechanics import Mechanism, mechanism_of

from ..recordings import Dataset, Recording
from ..signals import Signal, cut
from .column_toml import CURRENTS, OWN, check_per_joint
from .dataset_toml import DatasetToml, check_dataset_toml
from .formats import READERS, part_of
from .public_collections import cached, check_file, download_hint
from .table import read_table, table_name
from .table_recording import recorded

# From a file and the settings in [reader] to a recording in SI units.
Reader = Callable[[Path, Mapping[str, Any]], Recording]


def load_dataset(
    path: str | Path,
    data: str | Path | None = None,
    *,
    trust: bool = False,
    mechanism: Mechanism | None = None,
) -> Dataset:
    """The data set of a dataset.toml.

    Parameters
    ----------
    path : str or Path
        Folder with a dataset.toml, or that file.
    data : str or Path, optional
        Folder of the tables. Default: that of dataset.toml or, where it names a collection, the
        folder of that name in $FRICTIONID_DATA or in the cache.
    trust : bool
        Whether a reader or mechanism that dataset.toml names by its module may run.
    mechanism : Mechanism, optional
        In place of the kind that dataset.toml names; parameters are those of dataset.toml where it
        gives them.

    Returns
    -------
    Dataset
        Angles, torques and velocities in SI units, each on the clock of its file.
    """
    file = dataset_path(Path(path))
    document = read_toml(file)
    toml = check_dataset_toml(document, str(file))
    folder, names = _tables(toml, file, data)
    described_by = None if mechanism is not None else _mechanism_file(toml, file, folder)
    described = [] if described_by is None else [toml.mechanism.file]
    _check_names(toml.sha256, [*names, *described], f"{file}: sha256")
    _check_names(toml.recordings.parameters, names, f"{file}: recordings.parameters")
    read = None
    if toml.reader is not None and toml.columns is None:
        read = reader_of(toml.reader.kind, file, trust=trust)
    recordings, hashes = [], {}
    for name in names:
        content = read_bytes(folder / name)
        hashes[name] = _sha256(content, folder / name, toml.sha256.get(name))
        if toml.collection is not None:
            check_file(toml.collection, name, hashes[name], folder)
        recordings += _recordings(content, folder, name, toml, read)
    if described_by is not None:
        name = toml.mechanism.file
        hashes[name] = _sha256(read_bytes(described_by), described_by, toml.sha256.get(name))
    if toml.actuator is not None:
        toml.actuator.check_recordings([r.name for r in recordings], f"{file}: ")
    machine = _mechanism(document["mechanism"], file, described_by, mechanism, trust)
    _check_units(toml, machine, file)
    origin = {key: getattr(toml, key) for key in ("description", "origin", "licence", "citation")}
    return Dataset(
        name=toml.name,
        mechanism=machine,
        recordings=tuple(recordings),
        hashes=hashes,
        origin={key: text for key, text in origin.items() if text},
        truth=toml.truth,
        gears=toml.gears,
        torque_at=toml.torque.at,
    )


# Units of joints that slide; all others are those of joints that turn, but for currents.
_SLIDING = {"angle": ("m", "mm"), "velocity": ("m/s", "mm/s"), "torque": ("N",)}


def _check_units(toml: DatasetToml, mechanism: Mechanism, file: Path) -> None:
    """Refuse stated units that the mechanism's joints do not have."""
    for quantity in toml.units.model_fields_set & set(_SLIDING):
        units = getattr(toml.units, quantity)
        each = units * mechanism.n if len(units) == 1 else units
        for joint, unit, position in zip(
            mechanism.joints, each, mechanism.position_units, strict=False
        ):
            if unit not in (*CURRENTS, *OWN[quantity]) and (unit in _SLIDING[quantity]) != (
                position == "m"
            ):
                raise InputError(
                    f'{file}: units.{quantity} = "{unit}", but {joint} of {mechanism.kind} '
                    f"{'slides' if position == 'm' else 'turns'}: correct the unit"
                    + (", one per joint" if mechanism.n > 1 else "")
                )


def _mechanism_file(toml: DatasetToml, file: Path, folder: Path) -> Path | None:
    """File that describes the mechanism: beside dataset.toml, or in the folder of the tables."""
    name = toml.mechanism.file
    if not name:
        return None
    places = [file.parent / name, folder / name]
    return next((place for place in places if place.is_file()), places[0])


def _mechanism(
    table: dict[str, Any],
    file: Path,
    machine: Path | None,
    replacement: Mechanism | None,
    trust: bool,
) -> Mechanism:
    def code(kind: str) -> Any:
        return imported(kind, file.parent, "[mechanism] kind")

    try:
        if replacement is not None:
            return replacement.with_values(table.get("parameters", {}))
        if machine is not None:
            table = {k: str(machine) if k in ("urdf", "mjcf") else v for k, v in table.items()}
        return mechanism_of(table, code if trust else None)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def dataset_files(path: str | Path, data: str | Path | None = None) -> list[Path]:
    """Files that `load_dataset` reads: dataset.toml, its tables, what describes the mechanism."""
    file = dataset_path(Path(path))
    toml = check_dataset_toml(read_toml(file), str(file))
    folder, names = _tables(toml, file, data)
    machine = _mechanism_file(toml, file, folder)
    return [file, *([] if machine is None else [machine]), *(folder / name for name in names)]


def _tables(toml: DatasetToml, file: Path, data: str | Path | None) -> tuple[Path, list[str]]:
    """Folder of the tables, which the patterns are relative to, and their names in it."""
    collection = toml.collection
    if data is not None:
        folder = Path(data)
    elif collection is None:
        folder = file.parent
    elif collections := os.environ.get("FRICTIONID_DATA"):
        folder = Path(collections) / collection
    elif any(path.is_file() for path in cached(collection).rglob("*")):
        folder = cached(collection)
    else:
        raise InputError(
            f"{file}: its tables are in the collection {collection!r}; name their folder "
            "with --data FOLDER, or set FRICTIONID_DATA to the folder of the collections"
            f"{download_hint(collection)}"
        )
    if not folder.is_dir():
        raise InputError(
            f"{file}: the folder of its tables, {folder}, does not exist; create it, "
            "or name another one with --data FOLDER"
        )
    return folder, _matching(toml.recordings.patterns, folder, file)


def _matching(patterns: Iterable[str], folder: Path, file: Path) -> list[str]:
    """Sorted names, relative to the folder, of the files that match any pattern."""
    names: set[str] = set()
    for pattern in patterns:
        where = f"{file}: recordings.patterns: {pattern!r}"
        if ".." in Path(pattern).parts:
            raise InputError(f'{where} leaves the folder of the tables; write it without ".."')
        try:
            paths = [path for path in folder.glob(pattern) if path.is_file()]
        # Python's own limits on patterns: empty, absolute, "**" within a name, a null byte.
        except (ValueError, NotImplementedError, OSError) as error:
            raise InputError(f"{where} is no relative pattern ({error})") from None
        if not paths:
            raise InputError(
                f"{where} matches no file in {folder}; correct it, or name another "
                "folder with --data FOLDER"
            )
        names.update(path.relative_to(folder).as_posix() for path in paths)
    return sorted(names)


def _check_names(keys: Iterable[str], names: list[str], where: str) -> None:
    for key in keys:
        if key not in names:
            raise InputError(f"{where}: {key!r} is no file of this data set; {nearest(key, names)}")


def _sha256(content: bytes, file: Path, expected: str | None) -> str:
    digest = sha256(content)
    if expected not in (None, digest):
        raise InputError(
            f"{file} is not the described file: its SHA-256 is {digest}, dataset.toml says "
            f"{expected}; get the original, or correct [sha256]"
        )
    return digest


def _recordings(
    content: bytes, folder: Path, name: str, toml: DatasetToml, read: Reader | None
) -> list[Recording]:
    """Recordings of one file: a reader's, or one per table in it, named as file and part."""
    file, title = str(folder / name), table_name(name)
    parameters = toml.recordings.parameters.get(name, {})
    if read is not None:
        assert toml.reader is not None
        recording = read(folder / name, toml.reader.options)
        parameters = {**recording.parameters, **parameters}
        recordings = [_with_sigma(replace(recording, name=title, parameters=parameters), toml)]
    else:
        asked = toml.asked
        if toml.reader is None:
            tables = toml.runs(read_table(content, file, toml.names(), header=asked.header))
        else:
            read_tables = part_of(toml.reader.kind, "tables")
            tables = read_tables(content, file, toml.reader.options, asked)
        recordings = [recorded(t, toml, title + part, parameters) for part, t in tables.items()]
    start, stop = toml.recordings.start, toml.recordings.stop
    return (
        recordings
        if (start, stop) == (0.0, math.inf)
        else [within(r, start, stop) for r in recordings]
    )


def _with_sigma(recording: Recording, toml: DatasetToml) -> Recording:
    """The recording of a reader with the stated noise, in SI units."""
    signals: dict[str, Any] = {}
    for quantity, deviations in toml.sigma:
        signal = getattr(recording, quantity)
        if deviations is not None and signal is not None:
            joints = signal.value.shape[1]
            check_per_joint({f"sigma.{quantity}": deviations}, range(1, joints + 1))
            signals[quantity] = signal._replace(sigma=np.broadcast_to(deviations, joints).copy())
    return replace(recording, **signals)


def within(recording: Recording, start: float, stop: float) -> Recording:
    """The recording from ``start`` to ``stop`` [s] after its first angle sample.

    Raises
    ------
    InputError
        Where no sample lies in that span.
    """
    first = float(recording.angle.time[0])
    span = partial(cut, start=first + start, stop=first + stop)
    try:
        angle = span(recording.angle)
    except InputError:
        raise InputError(
            f"recording {recording.name!r}: no sample lies between start = {start:g} and "
            f"stop = {stop:g} s: it lasts {recording.angle.duration:g} s; choose a span inside it"
        ) from None
    return recording.changed(span, partial(_around, start=angle.time[0], stop=angle.time[-1]))


def _around(signal: Signal, start: float, stop: float) -> Signal:
    """Samples that determine a signal from start to stop: one more at each end than inside."""
    time = signal.time
    before = max(int(np.searchsorted(time, start, side="right")) - 1, 0)
    behind = min(int(np.searchsorted(time, stop, side="left")), len(time) - 1)
    return cut(signal, time[before], time[behind])


# --- Readers by their names -----------------------------------------------------------------------


def reader_of(kind: str, file: Path, *, trust: bool = False) -> Reader:
    """Reader of a name in dataset.toml: built-in, an installed one, or `package.module:function`.

    Installed packages offer readers as entry points of the group `frictionid.readers`, by their
    names. A reader by its module is code that the data set brings along: only with `trust` it is
    searched beside the dataset.toml, in the current folder and among the installed packages.

    Raises
    ------
    InputError
        Where there is no such reader, or it is not trusted.
    """
    installed = {point.name: point for point in entry_points(group="frictionid.readers")}
    if kind in installed and kind not in READERS:
        return _checked(installed[kind].load(), kind)
    if ":" in kind:
        if not trust:
            raise InputError(f"{file}: [reader] kind = {untrusted(kind)}")
        read = imported(kind, file.parent, f"{file}: [reader] kind")
        if not callable(read):
            raise InputError(f"{file}: [reader] kind = {kind!r} is no function (path, settings)")
        return _checked(read, kind)
    if kind not in READERS:
        raise InputError(
            f"{file}: [reader] kind = {kind!r} is unknown; {nearest(kind, READERS)}; one's own is "
            "package.module:function"
        )
    reader: Reader = part_of(kind, "read")
    return reader


def _checked(read: Reader, kind: str) -> Reader:
    """A reader of one's own, with errors that name it and the file."""

    def checked(path: Path, settings: Mapping[str, Any]) -> Recording:
        try:
            recording = read(path, settings)
        except InputError:
            raise
        except Exception as error:
            raise InputError(
                f"{path}: the reader {kind!r} failed ({type(error).__name__}: {error})"
            ) from error
        if not isinstance(recording, Recording):
            raise InputError(
                f"{path}: the reader {kind!r} must return a Recording, "
                f"not {type(recording).__name__}"
            )
        return recording

    return checked
