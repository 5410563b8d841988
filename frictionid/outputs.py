"""What a command may write over: one rule for all of them, checked before the work.

A file that exists is written over only with `--replace`, and what the same command reads never is.
A result folder lists what was written there in SHA256SUMS (`sha256sum -c` checks it): listed files
that are unchanged are made anew or removed, all others are the user's own and stay.
"""

import os
import stat
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from frictionid.errors import InputError
from frictionid.files import TEMPORARY, sha256, write_bytes, write_text

SUMS = "SHA256SUMS"


def check_outputs(
    outputs: Iterable[Path | None], inputs: Iterable[Path | None] = (), *, replace: bool = False
) -> None:
    """Check that these files can and may be written, before anything is computed.

    Parameters
    ----------
    outputs : iterable of Path or None
        Files to write; None for those that are not asked for.
    inputs : iterable of Path or None
        Files that are read, and folders of such files.
    replace : bool
        Whether files that exist may be written over.

    Raises
    ------
    InputError
        Where one of them exists, is read, is named twice, or cannot be written.
    """
    read, taken = [path for path in inputs if path is not None], set()
    for path in outputs:
        if path is None:
            continue
        check_writable(path)
        if path.is_dir():
            raise InputError(f"{path} is a folder: name a file in it")
        _check_not_read(path, read)
        if os.path.lexists(path):
            if not replace:
                raise InputError(
                    f"{path} exists: choose another name, or --replace to write over it"
                )
            if not stat.S_ISREG(os.lstat(path).st_mode):
                raise InputError(
                    f"{path} is no regular file and is not replaced: choose another name"
                )
        place = os.path.realpath(path)
        if place in taken:
            raise InputError(f"{path} is written by two options: name two files")
        taken.add(place)


def check_writable(path: Path) -> None:
    """Check that a file or folder can be made here, without making it.

    Raises
    ------
    InputError
        Where the name is impossible, or the folder cannot be written.
    """
    try:
        with suppress(FileNotFoundError):
            os.lstat(path)
        folder = path if path.is_dir() else next(p for p in path.absolute().parents if p.exists())
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _cannot(path, error) from None


def _cannot(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written ({error.strerror}): choose another --out")


def _check_not_read(path: Path, inputs: Iterable[Path]) -> None:
    """Complain about an output that is an input, or is there in a folder that is one."""
    place = os.path.realpath(path)
    for source in inputs:
        root = os.path.realpath(source)
        inside = os.path.isdir(root) and os.path.commonpath([root, place]) == root
        linked = os.path.isfile(root) and os.path.isfile(place) and os.path.samefile(root, place)
        if place == root or linked or (inside and os.path.lexists(path)):
            raise InputError(
                f"{path} belongs to what is read and is not overwritten: choose another name"
            )


# --- Result folders -------------------------------------------------------------------------------


def check_unchanged(folder: Path, *, replace: bool = False) -> None:
    """Check that nobody changed what was written to a result folder, unless it may be replaced."""
    for name, sums in sorted(_listed(folder).items()):
        _check_ours(folder / name, sums, replace)


def replace_files(folder: Path, contents: Mapping[str, bytes], *, replace: bool = False) -> None:
    """Write files of a result folder in place of those that were written there before.

    All are written beside and moved into place at the end. Listed files that are not among them are
    removed, unless they were changed. No link is followed.

    Parameters
    ----------
    folder : Path
    contents : mapping of str to bytes
        By the path below the folder, with "/".
    replace : bool
        Whether files may be replaced that are not listed, or were changed.

    Raises
    ------
    InputError
        Where a file is the user's own, a folder is a link, or the place cannot be written.
    """
    listed = _listed(folder)
    for name in contents:
        _check_place(folder, name, listed.get(name, frozenset()), replace)
    sums = {name: frozenset({sha256(content)}) for name, content in contents.items()}
    both = {n: listed.get(n, frozenset()) | sums.get(n, frozenset()) for n in {*listed, *sums}}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=TEMPORARY, dir=folder) as beside:
            staged = {name: Path(beside) / str(i) for i, name in enumerate(contents)}
            for name, place in staged.items():
                write_bytes(place, contents[name])
            _write_sums(folder, both)  # whatever happens from here on, all files are known as ours
            for name, place in staged.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(place, folder / name)
        _remove(folder, {name: listed[name] for name in listed.keys() - contents.keys()})
        _write_sums(folder, sums)
    except OSError as error:
        raise _cannot(folder, error) from None


def linked(folder: Path, path: Path) -> Path | None:
    """The first folder on the way from a folder to a path below it that is a link, None if none."""
    steps = path.relative_to(folder).parts[:-1]
    ways = (folder.joinpath(*steps[: i + 1]) for i in range(len(steps)))
    return next((way for way in ways if way.is_symlink()), None)


def _check_place(folder: Path, name: str, sums: frozenset[str], replace: bool) -> None:
    path = folder / name
    if link := linked(folder, path):
        raise InputError(f"{link} is a link to another folder, which is left alone: remove it")
    if path.is_dir() and not path.is_symlink():
        raise InputError(f"{path} is a folder where a file is to be written: move it")
    _check_ours(path, sums, replace)


def _check_ours(path: Path, sums: frozenset[str], replace: bool) -> None:
    if not replace and os.path.lexists(path) and not _is_ours(path, sums):
        raise InputError(
            f"{path} was changed, or is none that was written here: move it, or write over it with "
            "--replace"
        )


def _is_ours(path: Path, sums: Iterable[str]) -> bool:
    return path.is_file() and not path.is_symlink() and sha256(path.read_bytes()) in sums


def _remove(folder: Path, stale: Mapping[str, frozenset[str]]) -> None:
    """Remove listed files that are unchanged, and folders that are empty then."""
    for name, sums in stale.items():
        path = folder / name
        if linked(folder, path) is None and _is_ours(path, sums):
            path.unlink()
            if path.parent != folder and not any(path.parent.iterdir()):
                path.parent.rmdir()


def _write_sums(folder: Path, sums: Mapping[str, frozenset[str]]) -> None:
    lines = [f"{digest}  {name}\n" for name in sorted(sums) for digest in sorted(sums[name])]
    write_text(folder / SUMS, "".join(lines))


def _listed(folder: Path) -> dict[str, frozenset[str]]:
    """Hashes of each file that was written to a folder; two while a move was interrupted."""
    out: dict[str, frozenset[str]] = {}
    path = folder / SUMS
    text = path.read_text("utf-8", "replace") if path.is_file() else ""
    for line in text.splitlines():
        digest, _, name = line.partition("  ")
        parts = Path(name).parts
        if parts and ".." not in parts and not Path(name).is_absolute():
            out[name] = out.get(name, frozenset()) | {digest}
    return out
