"""The result folder while it is written: beside an earlier result, in whose place it comes at last.

unfinished/   a comparison that runs or was interrupted: its provenance.json, datasets.json, tasks/

Finished tasks are never deleted but by `replace`. Each carries the hash of its own content.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from frictionid.errors import InputError
from frictionid.files import (
    json_sha256,
    plain,
    read_json,
    remove_unfinished,
    sync_folder,
    write_json,
)
from frictionid.outputs import check_unchanged, linked

Document = Mapping[str, Any]  # as JSON has it
UNFINISHED = "unfinished"
PROVENANCE, DATASETS = "provenance.json", "datasets.json"
SEAL = "sha256"  # key of the hash of a document's content


def lock(
    folder: Path, files: Sequence[str] = (PROVENANCE, UNFINISHED), what: str = "comparison"
) -> AbstractContextManager[Any]:
    """A lock that keeps a second comparison out of a folder, which is known by one of some files.

    Raises
    ------
    InputError
        Where another process holds it, or the folder holds other things or cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = [path.name for path in folder.glob("[!.]*")]
        if names and not set(files) & set(names):
            other = min(names)
            raise InputError(f"{folder}: holds no {what} but {other!r}: choose another --out")
        held = FileLock(folder / ".lock", timeout=0)
        held.acquire()
    except Timeout:
        raise InputError(
            f"{folder}: another {what} is writing there: wait for it, or choose another --out"
        ) from None
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}): choose another --out"
        ) from None
    return held


@contextmanager
def unfinished(
    folder: Path, suite: str, files: Sequence[str], *, resume: bool, replace: bool
) -> Iterator[Path]:
    """Folder to make a comparison in; at the end it takes the place of an earlier result.

    Parameters
    ----------
    folder : Path
        Result folder.
    suite : str
        Name of the suite.
    files : sequence of str
        Names of the files of its tasks.
    resume : bool
        Keep the finished tasks of an interrupted comparison.
    replace : bool
        Whether the results of another suite, and finished tasks of an interrupted comparison, go.

    Raises
    ------
    InputError
        Where the folder holds what is not to be replaced.
    """
    check_unchanged(folder, replace=replace)
    place = folder / UNFINISHED
    before = _tasks(folder, suite, replace), _tasks(place, suite, replace)
    for path in (folder, place, folder / "tasks", place / "tasks"):
        if path != folder and path.is_symlink():
            raise InputError(f"{path} is a link, which is left alone: remove it")
        remove_unfinished(path)
    if not resume:
        _begin_anew(place, before[1], replace)
    yield place
    try:
        _move_into_place(place, folder, files)
        if replace:
            _remove_finished(folder, {*before[0], *before[1]} - set(files))
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}): finish the comparison with --resume"
        ) from None


def place_of(folder: Path, name: str) -> Path:
    """Where a file is: of the finished comparison or, while there is none, of the unfinished."""
    new = folder / UNFINISHED / name
    is_new = not (folder / PROVENANCE).exists() and new.exists()
    return new if is_new else folder / name


def read_sealed(path: Path) -> dict[str, Any]:
    """Document of a file, as it was written."""
    try:
        document = read_json(path)
    except InputError as error:
        if not path.exists():
            raise
        raise InputError(f"{error}: make it anew with --resume") from None
    if not is_sealed(document):
        raise InputError(f"{path}: was changed since it was written: make it anew with --resume")
    del document[SEAL]
    return document


def sealed(document: Document) -> dict[str, Any]:
    """The document as JSON has it, with the SHA-256 of its content.

    >>> is_sealed(sealed({"a": 1})), is_sealed({**sealed({"a": 1}), "a": 2})
    (True, False)
    """
    content = {key: value for key, value in plain(document).items() if key != SEAL}
    return {SEAL: json_sha256(content), **content}


def write_sealed(path: Path, document: Document, indent: int | None = None) -> None:
    """Write a document as a whole, with the SHA-256 of its content."""
    write_json(path, sealed(document), indent, durable=True)


def finished(path: Path, digest: str) -> dict[str, Any] | None:
    """The result in a file, None where it is of another digest, was changed, or is not there."""
    try:
        document = read_json(path)
    except InputError:
        return None
    return document if is_sealed(document) and document.get("digest") == digest else None


def is_sealed(document: Document) -> bool:
    """Whether a document has the content that it was sealed with."""
    return document.get(SEAL) == json_sha256({k: v for k, v in document.items() if k != SEAL})


def _tasks(folder: Path, suite: str, replace: bool) -> list[str]:
    """Names of the files of a folder's tasks, of this suite unless it may be replaced."""
    if not (folder / PROVENANCE).exists():
        return []
    try:
        document = read_json(folder / PROVENANCE)
    except InputError as error:
        if not replace:
            raise InputError(f"{error}: begin anew with --replace") from None
        document = {}
    other = document.get("suite")
    if other != suite and not replace:
        raise InputError(
            f"{folder}: holds the results of suite {other!r}: choose another --out, or --replace"
        )
    tasks = document.get("tasks", [])
    return [str(name) for name in tasks if Path(str(name)).name == name] if tasks else []


def _begin_anew(place: Path, files: Iterable[str], replace: bool) -> None:
    """Remove what an interrupted comparison has finished, where it may be replaced."""
    done = [name for name in files if (place / "tasks" / name).exists()]
    if done and not replace:
        raise InputError(
            f"{place}: holds {len(done)} finished tasks of an interrupted comparison: finish it "
            "with --resume, or begin anew with --replace"
        )
    _remove_finished(place, done)


def _remove_finished(folder: Path, files: Iterable[str]) -> None:
    """Remove results of tasks, but none that was changed."""
    for name in files:
        path = folder / "tasks" / name
        with suppress(InputError, FileNotFoundError):
            if linked(folder, path) is None and is_sealed(read_json(path)):
                path.unlink()


def _move_into_place(place: Path, folder: Path, files: Sequence[str]) -> None:
    """Move a comparison into the place of the earlier one, which is still whole until now.

    The syncs keep the order of the moves in a power cut: the two comparisons never mix.
    """
    (folder / "tasks").mkdir(exist_ok=True)
    (folder / PROVENANCE).unlink(missing_ok=True)  # from here on the unfinished one is what counts
    sync_folder(folder)
    for name in files:
        if (place / "tasks" / name).exists():
            os.replace(place / "tasks" / name, folder / "tasks" / name)
    sync_folder(folder / "tasks")
    for name in (DATASETS, PROVENANCE):
        os.replace(place / name, folder / name)
        sync_folder(folder)
    for empty in (place / "tasks", place):
        with suppress(OSError):  # the user's own files stay
            empty.rmdir()
