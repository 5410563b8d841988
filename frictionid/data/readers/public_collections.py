"""Public recordings: where the originals are, whose they are, and whether a file is one of them."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

from pydantic import Field

from frictionid.config import Strict, nearest
from frictionid.data.readers.table import content_of
from frictionid.errors import InputError


class File(Strict):
    """A file of a collection.

    name : its place in the folder of the collection
    source : its place in the original, None where nobody serves it at an address of its own
    sha256 : of the original, None where it is not known
    reduced : SHA-256 of a reduced copy, with fewer columns or digits, gzipped
    """

    name: str
    source: str | None = None
    sha256: str | None = None
    reduced: str | None = None

    @property
    def names(self) -> tuple[str, str]:
        """What the original and its reduced copy are called."""
        return self.name, f"{self.name}.gz"

    def accepts(self, found: str) -> bool:
        """Whether a SHA-256 is right; any is where that of the original is not known."""
        return self.sha256 is None or found in (self.sha256, self.reduced)


class Collection(Strict):
    """Recordings of one origin: page, address of the files, licence, what it allows, citation."""

    title: str
    page: str
    base: str = ""
    licence: str
    redistribution: str
    citation: str
    files: list[File] = Field(min_length=1)


@cache
def collections() -> Mapping[str, Collection]:
    """All collections that are known, by name.

    >>> collections()["emps"].redistribution
    'not stated: keep it to yourself'
    """
    text = files("frictionid.data.readers").joinpath("registry.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    return MappingProxyType({n: Collection.model_validate(t) for n, t in tables.items()})


def collection_named(name: str) -> Collection:
    """The collection of that name; InputError with the nearest one where there is none."""
    if name not in collections():
        raise InputError(f"collection {name!r} is unknown; {nearest(name, collections())}")
    return collections()[name]


def cached(name: str) -> Path:
    """Folder of a collection: in FRICTIONID_DATA where that is set, else in the user's cache."""
    import pooch

    home = os.environ.get("FRICTIONID_DATA") or pooch.os_cache("frictionid")
    return Path(home) / name


def is_cached(name: str) -> bool:
    """Whether anything of a collection is in its folder; a failed download leaves an empty one."""
    return any(path.is_file() for path in cached(name).rglob("*"))


def way_to_get(name: str) -> str:
    """Words that say how to get a collection, for errors; none where it is not known."""
    return f", or get it with: frictionid data get {name}" if name in collections() else ""


def check_file(collection: str, name: str, found: str, folder: Path) -> None:
    """Refuse a file of a known collection whose SHA-256 is neither the original's nor the reduced.

    Files and collections that are not in the registry are the user's own.
    """
    if collection not in collections():
        return
    for file in collections()[collection].files:
        if name in file.names and not file.accepts(found):
            known = f"{file.sha256} (original)"
            known += f" or {file.reduced} (reduced)" if file.reduced else ""
            raise InputError(
                f"{folder / name} is not the registered file: its SHA-256 is {found}, the registry "
                f"says {known}; remove it and run: frictionid data get {collection}"
            )


def present(name: str) -> int:
    """Number of a collection's files that are in its folder, originals or reduced."""
    folder = cached(name)
    return sum(_at(folder, file) is not None for file in collection_named(name).files)


def take(name: str, source: Path) -> list[str]:
    """Copy a collection from a folder into its own; names of the files that were not there.

    The folder may hold the originals or the reduced files under their names here, or the originals
    as their project lays them out. Nothing is copied before all hashes are found right.

    Raises
    ------
    InputError
        Where the folder has none of the files, or one with a wrong hash.
    """
    if not source.is_dir():
        raise InputError(f"--from {source} is no folder; name the folder that holds the files")
    found, missing = {}, []
    for file in collection_named(name).files:
        place = _at(source, file) or _original_at(source, file)
        if place is None:
            missing.append(file.name)
            continue
        target = file.names[1] if place.name.endswith(".gz") else file.name
        check_file(name, target, _hash(place), place.parent)
        found[target] = place
    if not found:
        raise InputError(
            f"--from {source} has no file of {name}; it should hold {missing[0]}, or the "
            f"original's own folders ({collection_named(name).page})"
        )
    for target, place in found.items():
        _copy(place, cached(name) / target)
    return missing


def download(name: str, done: Callable[[str], None]) -> None:
    """Fetch what is missing of a collection; each file is checked before it stands in its folder.

    Raises
    ------
    InputError
        Without a network or with a wrong hash, saying how to go on without.
    """
    collection, folder = collection_named(name), cached(name)
    for file in collection.files:
        if _at(folder, file) is None:
            if not (file.source and file.sha256):
                raise InputError(
                    f"{file.name} of {name} cannot be downloaded, nobody serves it at an address "
                    f"of its own: get it from {collection.page}, {from_line(name)}"
                )
            _retrieve(collection.base + file.source, file, folder, name)
        done(file.name)


def from_line(name: str) -> str:
    """The command that takes a collection from a folder instead of the network."""
    return f"then run: frictionid data get {name} --from FOLDER"


def _retrieve(url: str, file: File, folder: Path, name: str) -> None:
    import pooch

    pooch.get_logger().setLevel("WARNING")
    target = folder / file.name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        pooch.retrieve(url, f"sha256:{file.sha256}", fname=target.name, path=target.parent)
    except ValueError as error:  # a wrong hash: the message names both
        raise InputError(f"{url}: {error}") from None
    except OSError as error:  # no network, or no room: those of requests are OSErrors, too
        reason = str(error).partition("\n")[0][:160]
        raise InputError(
            f"{url} cannot be downloaded to {target.parent} ({type(error).__name__}: {reason}); "
            f"get the files elsewhere, {from_line(name)}"
        ) from None


def _at(folder: Path, file: File) -> Path | None:
    return next((folder / name for name in file.names if (folder / name).is_file()), None)


def _original_at(folder: Path, file: File) -> Path | None:
    place = folder / (file.source or file.name)
    return place if place.is_file() else None


def _hash(file: Path) -> str:
    return hashlib.sha256(content_of(file)).hexdigest()


def _copy(source: Path, target: Path) -> None:
    """Copy a file so that it stands there whole or not at all."""
    if target.exists() and target.samefile(source):
        return
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as folder:
            shutil.copyfile(source, Path(folder) / "copy")
            os.replace(Path(folder) / "copy", target)
    except OSError as error:
        raise InputError(
            f"{target} cannot be written ({error.strerror}); set FRICTIONID_DATA to another folder"
        ) from None
