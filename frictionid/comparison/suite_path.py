"""Where a suite is: light, so that a wrong path is refused at once."""

from difflib import get_close_matches
from pathlib import Path

from frictionid.errors import InputError


def suite_path(path: Path) -> Path:
    """The path of a suite.

    Raises
    ------
    InputError
        Where no such file exists, with the nearest one.
    """
    if path.exists():
        return path
    others = sorted(str(p) for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    near = get_close_matches(str(path), others, n=1)
    raise InputError(f"{path}: no such suite{f'; did you mean {near[0]}?' if near else ''}")
