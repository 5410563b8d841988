"""Where a suite is: light, so that a wrong path is refused at once."""

from difflib import get_close_matches
from pathlib import Path

from frictionid.errors import InputError
from frictionid.shipped import is_shipped, shipped, shipped_names


def suite_path(path: Path) -> Path:
    """The path of a suite: a file, or else the suite of that name that comes with the package.

    Raises
    ------
    InputError
        Where there is neither, with the nearest one.

    Examples
    --------
    >>> suite_path(Path("acrobot")).name
    'acrobot.toml'
    """
    if path.is_file() or (path.exists() and not is_shipped(path, "comparisons")):
        return path
    if is_shipped(path, "comparisons"):
        return shipped("comparisons") / f"{path}.toml"
    others = sorted(str(p) for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    near = get_close_matches(str(path), [*others, *shipped_names("comparisons")], n=1)
    raise InputError(f"{path}: no such suite{f'; did you mean {near[0]}?' if near else ''}")
