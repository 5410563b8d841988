"""Public recordings: origin, licence and hashes of their files, and how to get them."""

import os
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

from pydantic import Field

from frictionid.config import Strict, nearest, parse_toml
from frictionid.errors import InputError, needs
from frictionid.files import read_bytes, sha256, write_bytes


class File(Strict):
    """A file of a collection.

    name : its place in the folder of the collection
    source : path below the address of the collection, None where it has no address of its own
    sha256 : of the original, None where it is unknown, so that any is right
    reduced : SHA-256 of a reduced copy, with fewer columns or digits, gzipped
    """

    name: str
    source: str | None = None
    sha256: str | None = None
    reduced: str | None = None

    @property
    def names(self) -> tuple[str, str]:
        """Names of the original and of its reduced copy."""
        return self.name, f"{self.name}.gz"


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
    """All registered collections by name.

    >>> collections()["emps"].redistribution
    'not stated: keep it to yourself'
    """
    text = files("frictionid.data.readers").joinpath("public_collections.toml").read_bytes()
    tables = parse_toml(text, "public_collections.toml")
    return MappingProxyType({n: Collection.model_validate(t) for n, t in tables.items()})


def collection_named(name: str) -> Collection:
    """The collection of that name; InputError with the nearest one where there is none."""
    if name not in collections():
        raise InputError(f"collection {name!r} is unknown; {nearest(name, collections())}")
    return collections()[name]


def cached(name: str) -> Path:
    """Folder of a collection: in $FRICTIONID_DATA where that is set, else in the user's cache."""
    with needs("public"):
        import pooch

    home = os.environ.get("FRICTIONID_DATA") or pooch.os_cache("frictionid")
    return Path(home) / name


def download_hint(name: str) -> str:
    """Part of an error message that says how to get a collection, "" for an unknown one."""
    return f", or get it with: frictionid data get {name}" if name in collections() else ""


def check_file(collection: str, name: str, digest: str, folder: Path) -> None:
    """Raise InputError for a registered file with an unknown SHA-256.

    Files and collections that are not registered are the user's own.
    """
    if collection not in collections():
        return
    for file in collections()[collection].files:
        if name in file.names and file.sha256 and digest not in (file.sha256, file.reduced):
            hashes = f"{file.sha256} (original)"
            hashes += f" or {file.reduced} (reduced)" if file.reduced else ""
            raise InputError(
                f"{folder / name} is not the registered file: its SHA-256 is {digest}, the "
                f"registry says {hashes}; remove it and run: frictionid data get {collection}"
            )


def count_present(name: str) -> int:
    """Number of a collection's files that are in its folder, originals or reduced."""
    folder = cached(name)
    return sum(_at(folder, *file.names) is not None for file in collection_named(name).files)


def copy_collection(name: str, source: Path) -> list[str]:
    """Copy a collection from a folder into its own; the names of missing files.

    The folder may hold the originals or the reduced copies under their registered names, or the
    originals in the layout of their project. Nothing is copied before all hashes are checked.

    Raises
    ------
    InputError
        Where the folder has none of the files, or one with a wrong hash.
    """
    if not source.is_dir():
        raise InputError(f"--from {source} is no folder; name the folder that holds the files")
    places, missing = {}, []
    for file in collection_named(name).files:
        place = _at(source, *file.names, file.source or file.name)
        if place is None:
            missing.append(file.name)
            continue
        target = file.names[1] if place.name.endswith(".gz") else file.name
        check_file(name, target, sha256(read_bytes(place)), place.parent)
        places[target] = place
    if not places:
        raise InputError(
            f"--from {source} has no file of {name}; it should hold {missing[0]}, or the "
            f"original's own folders ({collection_named(name).page})"
        )
    for target, place in places.items():
        target_path = cached(name) / target
        if not (target_path.exists() and target_path.samefile(place)):
            write_bytes(target_path, read_bytes(place))
    return missing


def download(name: str, done: Callable[[str], None]) -> None:
    """Download the missing files of a collection; each is checked before it is stored.

    Raises
    ------
    InputError
        Without a network or with a wrong hash, saying how to go on without.
    """
    collection, folder = collection_named(name), cached(name)
    for file in collection.files:
        if _at(folder, *file.names) is None:
            if not (file.source and file.sha256):
                raise InputError(
                    f"{file.name} of {name} cannot be downloaded, nobody serves it at an address "
                    f"of its own: get it from {collection.page}, {folder_hint(name)}"
                )
            _retrieve(collection.base + file.source, file, folder, name)
        done(file.name)


def folder_hint(name: str) -> str:
    """The command that copies a collection from a folder."""
    return f"then run: frictionid data get {name} --from FOLDER"


def _retrieve(url: str, file: File, folder: Path, name: str) -> None:
    with needs("public"):
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
            f"get the files elsewhere, {folder_hint(name)}"
        ) from None


def _at(folder: Path, *names: str) -> Path | None:
    """The first of the named files that is in a folder."""
    return next((folder / name for name in names if (folder / name).is_file()), None)
