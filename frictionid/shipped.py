"""Suites and data sets that come with the package: found by name, from any folder."""

from pathlib import Path
from typing import Literal

Kind = Literal["comparisons", "data"]


def shipped(kind: Kind) -> Path:
    """Folder of what comes with the package: within it where it is installed, beside it in a clone.

    >>> (shipped("comparisons") / "acrobot.toml").is_file()
    True
    """
    package = Path(__file__).parent
    installed = package / "share"
    return (installed if installed.is_dir() else package.parent) / kind


def shipped_names(kind: Kind) -> list[str]:
    """Names of the suites, or of the data sets, that come with the package.

    >>> "acrobot" in shipped_names("comparisons"), "acrobot_clean" in shipped_names("data")
    (True, True)
    """
    pattern = {"comparisons": "*.toml", "data": "*/dataset.toml"}[kind]
    folder = shipped(kind)
    return sorted(
        p.relative_to(folder).parts[0].removesuffix(".toml") for p in folder.glob(pattern)
    )


def is_shipped(path: Path, kind: Kind) -> bool:
    """Whether a path is nothing but the name of something that comes with the package."""
    return str(path) == path.name and path.name in shipped_names(kind)
