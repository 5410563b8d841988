"""Files: read within bounds, written as a whole or not at all, as JSON, and by name."""

import errno
import hashlib
import json
import math
import os
import re
import secrets
import shutil
import stat
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

import numpy as np

from frictionid.errors import InputError

_FULL = (errno.ENOSPC, errno.EDQUOT)  # no space, or no more of it for this user
TEMPORARY = ".frictionid-"  # begins the names of files that are being written
# Packed files are unpacked as far as a recording may be large: small ones must not fill memory.
_SMALL, _RATIO, _LARGEST = 1 << 26, 100, 1 << 30  # [bytes], unpacked over packed, [bytes]
CELLS = 50_000_000  # of a table
TABLES = (".csv", ".csv.gz", ".parquet", ".xlsx", ".mat", ".npz")
BAGS = (".mcap", ".db3")  # of ROS 2


def regular_file(path: Path) -> Path:
    """The path, of whatever is opened by its name: a pipe, a socket or a device is refused.

    They may have no end, and would be waited for. Missing files and folders are left to readers.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return path
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(f"{path} is no regular file but a pipe, socket or device: name a file")
    return path


def read_bytes(path: Path) -> bytes:
    """Content of a file.

    Raises
    ------
    InputError
        Where it cannot be read, or is no regular file.
    """
    try:
        return regular_file(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check it") from None


def most_bytes(packed: int) -> int:
    """Largest size [bytes] that a packed file may unpack to: 64 MiB, or 100 times its own."""
    return min(max(_SMALL, _RATIO * packed), _LARGEST)


def unzip(content: bytes, file: str) -> bytes:
    """Content of a file, unpacked where its name ends with .gz.

    Raises
    ------
    InputError
        Where it is damaged, or unpacks to more than a recording has.
    """
    if not file.lower().endswith(".gz"):
        return content
    most, parts, rest = most_bytes(len(content)), [], content
    try:
        while rest:  # a file may have several members
            stream = zlib.decompressobj(wbits=31)
            parts.append(stream.decompress(rest, most + 1))
            most -= len(parts[-1])
            if most < 0:
                size = most_bytes(len(content)) / 1e6
                raise InputError(
                    f"{file}: {len(content) / 1e6:.3g} MB unpack to over {size:.0f} MB: unpack "
                    "it yourself where that is right"
                )
            if not stream.eof:
                raise EOFError("it is cut off")
            rest = stream.unused_data.lstrip(b"\0")
    except (EOFError, zlib.error) as error:
        raise InputError(f"{file} is no whole gzip file ({error}); copy it again") from None
    return b"".join(parts)


def check_cells(rows: int, columns: int, file: str) -> None:
    """Check that a packed table is not larger than memory should be.

    Raises
    ------
    InputError
        Where it has more cells than `CELLS`.
    """
    if rows * columns > CELLS:
        raise InputError(
            f"{file}: {rows} rows of {columns} columns are more than {CELLS} numbers: cut it into "
            "several recordings"
        )


def sha256(content: bytes) -> str:
    """Its SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def json_sha256(document: Mapping[str, Any]) -> str:
    """SHA-256 of a document, whatever the order of its keys."""
    return sha256(json.dumps(document, sort_keys=True).encode())


def write_text(path: Path, text: str, *, durable: bool = False) -> None:
    """Write a text file as a whole or not at all, see `write_bytes`."""
    write_bytes(path, text.encode(), durable=durable)


def write_bytes(path: Path, content: bytes, *, durable: bool = False) -> None:
    """Write a file as a whole or not at all, with the permissions of new files; its folder is made.

    durable : it survives a power cut, too, from the moment that this returns
    """
    with written_beside(path) as beside:
        beside.write_bytes(content)
        if durable:
            _sync(beside, os.O_RDWR)
    if durable:
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Put the names of a folder's files on the disk, where its file system can."""
    with suppress(OSError):
        _sync(folder)


def _sync(path: Path, mode: int = os.O_RDONLY) -> None:
    handle = os.open(path, mode)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """An empty file beside a path, with its ending, that takes its place at the end.

    It is removed where the block fails: what stood at the path stays.
    """
    beside = path.with_name(f"{TEMPORARY}{secrets.token_hex(4)}{path.suffix[-16:]}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.touch(exist_ok=False)
        yield beside
        os.replace(beside, path)
    except OSError as error:
        advice = "make room, or choose" if error.errno in _FULL else "choose"
        raise InputError(
            f"{path}: cannot be written ({error.strerror}): {advice} another place"
        ) from None
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def remove_unfinished(folder: Path) -> None:
    """Remove what `write_bytes` left in a folder when it was killed."""
    for path in folder.glob(f"{TEMPORARY}*"):
        if path.is_symlink() or path.is_file():
            path.unlink()
        else:
            shutil.rmtree(path, ignore_errors=True)


def write_json(
    path: Path, document: Mapping[str, Any], indent: int | None = 1, *, durable: bool = False
) -> None:
    """Write a document as JSON, see `json_text` and `write_bytes`."""
    write_text(path, json_text(document, indent), durable=durable)


def json_text(document: Any, indent: int | None = 1) -> str:
    """A document as JSON; infinities become the strings "inf" and "-inf", NaN null."""
    return json.dumps(plain(document), indent=indent, allow_nan=False) + "\n"


def finite_json(document: Any) -> str:
    """A document as JSON; null for what is not finite."""
    return json.dumps(plain(document, infinity=None), indent=1, allow_nan=False)


def csv_text(frame: Any) -> str:
    """A frame as CSV; numbers have nine digits."""
    return str(frame.to_csv(index=False, float_format="%.9g"))


def read_json(path: Path) -> dict[str, Any]:
    """Document of a JSON file."""
    regular_file(path)
    text = " "
    try:
        text = path.read_text(encoding="utf-8")
        document = json.loads(text)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    # ValueError: no JSON, no UTF-8, or a name that no file can have
    except (ValueError, RecursionError) as error:
        reason = f"no JSON ({error})" if text else "empty"
        raise InputError(f"{path}: is {reason}; name a file that frictionid wrote") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: must hold a JSON object, it holds a {type(document).__name__}")
    return document


def plain(value: Any, infinity: str | None = "inf") -> Any:
    """The value as JSON has it: mappings, lists, texts, finite numbers and null.

    Dataclasses and named tuples become mappings. NaN becomes null, and infinities the text
    `infinity`, with a minus where they are negative, or null.

    >>> plain({"a": np.array([1.0, -np.inf, np.nan])})
    {'a': [1.0, '-inf', None]}
    """
    if isinstance(value, Mapping):
        return {str(k): plain(v, infinity) for k, v in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name), infinity) for f in fields(value)}
    if hasattr(value, "_asdict"):
        return plain(value._asdict(), infinity)
    if isinstance(value, np.ndarray | np.generic):
        whole = value.dtype.kind in "iub" or (value.dtype.kind == "f" and np.isfinite(value).all())
        return value.tolist() if whole else plain(value.tolist(), infinity)
    if isinstance(value, list | tuple):
        return [plain(v, infinity) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        sign = "-" if value < 0 else ""
        return None if math.isnan(value) or infinity is None else f"{sign}{infinity}"
    return str(value) if isinstance(value, Path) else value


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


Kind = Literal["comparisons", "data", "machines"]


def shipped(kind: Kind) -> Path:
    """Folder of what comes with the package: within it where it is installed, beside it in a clone.

    >>> (shipped("comparisons") / "acrobot.toml").is_file()
    True
    """
    package = Path(__file__).parent
    installed = package / "share"
    return (installed if installed.is_dir() else package.parent) / kind


def shipped_names(kind: Kind) -> list[str]:
    """Names of the suites, the data sets or the machines that come with the package.

    >>> "acrobot" in shipped_names("comparisons"), "acrobot_clean" in shipped_names("data")
    (True, True)
    """
    pattern = {"comparisons": "*.toml", "data": "*/dataset.toml", "machines": "*.json"}[kind]
    folder = shipped(kind)
    names = (p.relative_to(folder).parts[0] for p in folder.glob(pattern))
    return sorted(name.removesuffix(pattern[1:]) for name in names)


def is_shipped(path: Path, kind: Kind) -> bool:
    """Whether a path is nothing but the name of something that comes with the package."""
    return str(path) == path.name and path.name in shipped_names(kind)


def suite_path(path: Path) -> Path:
    """The path of a suite: a file, a folder's suite.toml, or a suite's name in the package.

    Examples
    --------
    >>> suite_path(Path("acrobot")).name
    'acrobot.toml'
    """
    inside = path / "suite.toml"
    if inside.is_file():
        return inside
    if is_shipped(path, "comparisons") and not path.is_file():
        return shipped("comparisons") / f"{path}.toml"
    if path.is_dir():
        raise InputError(f"{path} is a folder without suite.toml; name a suite")
    if path.exists():
        return path
    others = sorted(str(p) for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    near = get_close_matches(str(path), [*others, *shipped_names("comparisons")], n=1)
    raise InputError(f"{path}: no such suite{f'; did you mean {near[0]}?' if near else ''}")


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


def model_path(path: Path) -> Path:
    """The path of a model file; `machine:NAME` is the card of a machine that comes along.

    Examples
    --------
    >>> model_path(Path("machine:xl330_m1")).name
    'xl330_m1.json'
    """
    kind, colon, name = str(path).partition(":")
    if kind != "machine" or not colon:
        return path
    if name not in (names := shipped_names("machines")):
        near = get_close_matches(name, names, n=1)
        there = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"
        raise InputError(f"{path}: no such machine; {there}")
    return shipped("machines") / f"{name}.json"
