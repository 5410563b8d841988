"""Files of a report: each written as a whole, and those of an earlier report removed."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def remove_others(folder: Path, kept: Iterable[Path]) -> None:
    """Remove the files of a folder that are none of those kept."""
    stay = set(kept)
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.is_file() and path not in stay:
            path.unlink()


def file_names(names: Iterable[str]) -> dict[str, str]:
    """A name of a file for each name, all different, also where the disk ignores case.

    >>> file_names(["my rig", "my-rig", "acrobot_sim"])
    {'my rig': 'my-rig', 'my-rig': 'my-rig-2', 'acrobot_sim': 'acrobot_sim'}
    """
    out: dict[str, str] = {}
    for name in names:
        base = re.sub(r"[^A-Za-z0-9_.+-]+", "-", name).lstrip(".") or "unnamed"
        taken = {other.lower() for other in out.values()}
        tries = (base, *(f"{base}-{i}" for i in range(2, len(out) + 3)))
        out[name] = next(t for t in tries if t.lower() not in taken)
    return out
