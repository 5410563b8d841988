"""Readers by their names in dataset.toml: those of `formats`, installed ones, and one's own."""

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from frictionid.config import imported, nearest, untrusted
from frictionid.errors import InputError

from ..recordings import Recording
from .formats import READERS, part_of

# From a file and the settings in [reader] to a recording in SI units.
Reader = Callable[[Path, Mapping[str, Any]], Recording]


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
