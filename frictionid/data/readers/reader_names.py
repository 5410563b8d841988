"""Readers by their names in dataset.toml, and readers of one's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from frictionid.config import imported, nearest
from frictionid.data.readers.bam import read_bam
from frictionid.data.readers.dfki import (
    read_dfki_double_pendulum,
    read_dfki_simple_pendulum,
)
from frictionid.data.readers.emps import read_emps
from frictionid.data.readers.ibm import read_ibm
from frictionid.data.readers.markers import read_markers
from frictionid.data.readers.phy180 import read_phy180
from frictionid.data.readers.ros import read_ros
from frictionid.data.readers.table_formats import TABLE_FORMATS
from frictionid.data.recordings import Recording
from frictionid.errors import InputError

# From a file and the settings in [reader] to a recording in SI units.
Reader = Callable[[Path, Mapping[str, Any]], Recording]

READERS: Mapping[str, Reader] = {
    "bam": read_bam,
    "dfki_double_pendulum": read_dfki_double_pendulum,
    "dfki_simple_pendulum": read_dfki_simple_pendulum,
    "emps": read_emps,
    "ibm": read_ibm,
    "markers": read_markers,
    "phy180": read_phy180,
    "ros": read_ros,
}


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
            raise InputError(
                f"{file}: [reader] kind = {kind!r} is code, which runs with your rights: read it, "
                "and give --trust (trust=True in Python) where it is harmless"
            )
        found = imported(kind, file.parent, f"{file}: [reader] kind")
        if not callable(found):
            raise InputError(f"{file}: [reader] kind = {kind!r} is no function (path, settings)")
        return _checked(found, kind)
    if kind not in READERS:
        known = dict.fromkeys([*READERS, *TABLE_FORMATS])
        raise InputError(
            f"{file}: [reader] kind = {kind!r} is unknown; {nearest(kind, known)}; one's own is "
            "package.module:function"
        )
    return READERS[kind]


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
