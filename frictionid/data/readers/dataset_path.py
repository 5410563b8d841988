"""Where the dataset.toml of a data set is: light, so that a wrong path is refused at once."""

from pathlib import Path

from frictionid.errors import InputError
from frictionid.files import is_shipped, regular_file, shipped

TABLES = (".csv", ".csv.gz", ".parquet", ".xlsx", ".mat", ".npz")
BAGS = (".mcap", ".db3")  # of ROS 2


def dataset_path(path: Path) -> Path:
    """The dataset.toml of a path to it, or to its folder.

    A name that is no path is that of a data set that comes with the package.

    Raises
    ------
    InputError
        Where there is none; where there are tables, with the command that describes them.

    Examples
    --------
    >>> dataset_path(Path("acrobot_clean")).parts[-2:]
    ('acrobot_clean', 'dataset.toml')
    """
    if not path.exists() and is_shipped(path, "data"):
        path = shipped("data") / path
    file = regular_file(path / "dataset.toml" if path.is_dir() else path)
    bare = path.is_dir() and not file.exists()
    if is_table(file) or (bare and any(map(is_table, path.glob("*")))):
        raise InputError(f"{path} has no dataset.toml; write one with frictionid init {path}")
    if not file.is_file():
        raise InputError(f"{file} does not exist; name a folder with a dataset.toml, or that file")
    return file


def is_table(path: Path) -> bool:
    """Whether a path is that of a table, or a bag, by its ending."""
    return path.is_file() and (path.name.lower().endswith(TABLES) or path.suffix in BAGS)
