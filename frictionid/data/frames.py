"""Recordings from data frames and arrays: columns as in dataset.toml, read by the same code."""

from collections.abc import Mapping, Sequence
from numbers import Number
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.files import sha256

from .readers.column_toml import SPELLINGS
from .readers.dataset_toml import DatasetToml, check_dataset_toml
from .readers.table import Table, rate_of, with_times
from .readers.table_recording import recorded
from .recording import Recording
from .signals import Array

Names = str | Sequence[str | None] | None
Units = str | Sequence[str] | Mapping[str, str | Sequence[str]] | None
Numbers = float | Sequence[float]
Noise = Numbers | Mapping[str, Numbers] | None
Times = str | Mapping[str, str] | None
Keys = Mapping[str, Any] | None  # of a table of a dataset.toml

_RATES = {"deg": "deg/s", "m": "m/s", "mm": "mm/s"}  # of velocities, where the angles are in these
INDEX = "index"  # the time, where no column is named
_KEYS = ("time", "angle", "torque", "velocity", "torque_time")  # of arrays


def read_frames(
    toml: DatasetToml, frames: Any, parameters: Mapping[str, Mapping[str, float]]
) -> dict[str, tuple[Recording, str]]:
    """Recordings of several frames, by name, or of a single one, and SHA-256 of their columns.

    parameters : of the mechanism, by the names of the recordings in which they differ

    Raises
    ------
    InputError
        Where a column is missing, is no number, or its time does not increase, and where an
        actuator names recordings that are none of these.
    """
    recordings = frames if isinstance(frames, Mapping) else {"recording": frames}
    names = toml.names()
    tables = {
        f"{key}{part}": table
        for key, frame in recordings.items()
        for part, table in toml.runs(_table(frame, names, f"frame {str(key)!r}")).items()
    }
    if toml.actuator is not None:
        toml.actuator.check_recordings(list(tables), "")
    return {
        name: (recorded(table, toml, name, parameters.get(name, {})), _digest(table))
        for name, table in tables.items()
    }


def _digest(table: Table) -> str:
    columns = table.columns.items()
    return sha256(
        b"".join(c.encode() + np.ascontiguousarray(v, "<f8").tobytes() for c, v in columns)
    )


def toml_of_columns(
    *,
    time: Times = None,
    angle: Names = None,
    torque: Names = None,
    velocity: Names = None,
    units: Units = None,
    signs: Mapping[str, Numbers] | None = None,
    motor: Keys = None,
    torque_at: str = "motor",
    actuator: Keys = None,
    base: Keys = None,
    hold: str | None = None,
    sigma: Noise = None,
    covariates: Mapping[str, str] | None = None,
    missing: str = "refuse",
    split: str | None = None,
) -> DatasetToml:
    """The dataset.toml of frames with these columns, see `Dataset.from_frames`.

    Its mechanism and files are nothing: they are here.

    Raises
    ------
    InputError
        Where it would be wrong, and without columns of angles.
    """
    angles, torques, velocities = map(_names, (angle, torque, velocity))
    if not angles:
        raise InputError('name the columns of the angles, e.g. angle=["q1", "q2"]')
    noise = sigma if isinstance(sigma, Mapping) else {"angle": sigma}
    tables = {"motor": motor, "actuator": actuator, "base": base}
    document = {
        "name": "frames",
        "mechanism": {"kind": "given"},
        "recordings": {"patterns": ["*"], "split": split},
        "columns": {
            "time": dict(time) if isinstance(time, Mapping) else time or INDEX,
            "angle": angles,
            "torque": torques or [""] * len(angles),
            **({"velocity": velocities} if velocities else {}),
            "covariates": _plain(covariates or {}),
            "missing": missing,
        },
        "units": _units(units),
        "signs": {k: _listed(v) for k, v in by_name(signs or {}, "signs").items()},
        "sigma": {key: _listed(value) for key, value in noise.items() if value is not None},
        "hold": {} if hold is None else {"torque": hold},
        "torque": {"at": torque_at},
        **{key: _plain(table) for key, table in tables.items() if table is not None},
    }
    return check_dataset_toml(document, "columns of the frames")


def _names(names: Names) -> list[str]:
    """Names of columns, "" where there is none."""
    listed = list(names) if isinstance(names, Sequence) and not isinstance(names, str) else [names]
    return [] if listed == [None] else ["" if name is None else str(name) for name in listed]


def by_name(value: Any, what: str) -> Mapping[str, Any]:
    """The value, which must be a mapping; `what` names it."""
    if not isinstance(value, Mapping):
        raise InputError(f"{what}: must be a dict by names, not a {type(value).__name__}")
    return value


def _listed(value: Any) -> list[Any]:
    return np.atleast_1d(np.asarray(value)).tolist()


def _plain(value: Any) -> Any:
    """Tables and lists of Python's own numbers, as TOML has them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    return np.asarray(value).tolist()


def _units(units: Units) -> dict[str, Any]:
    """Units as in a dataset.toml.

    A unit without its quantity is that of the angles, and per second that of the velocities.
    """
    named = units if isinstance(units, Mapping) else {} if units is None else {"angle": units}
    out = {key: unit if key == "time" else _listed(unit) for key, unit in named.items()}
    if "angle" in out and "velocity" not in out:
        angles = (SPELLINGS["angle"].get(unit, unit) for unit in out["angle"])
        out["velocity"] = [_RATES.get(unit, "rad/s") for unit in angles]
    return out


def _table(frame: Any, names: Sequence[str], where: str) -> Table:
    """Columns of a frame as numbers; rows count from 0."""
    if not hasattr(frame, "columns"):
        raise InputError(
            f"{where}: is a {type(frame).__name__}, not a table: give a DataFrame, or arrays to "
            "Dataset.from_arrays"
        )
    labels = [str(label) for label in frame.columns]
    length = len(frame)
    if not length:
        raise InputError(f"{where}: has no rows")
    columns = {}
    for name in names:
        if rate_of(name):
            continue
        if name == INDEX and name not in labels:
            columns[name] = _numbers(frame.index, "index", where)
            continue
        if name not in labels:
            raise InputError(f"{where}: has no column {name!r}; {nearest(name, labels)}")
        if labels.count(name) > 1:
            raise InputError(
                f"{where}: has {labels.count(name)} columns called {name!r}; rename them"
            )
        columns[name] = _numbers(frame[frame.columns[labels.index(name)]], name, where)
    return with_times(Table(where, np.arange(length), columns), names)


def _numbers(values: Any, name: str, where: str) -> Array:
    """Cells of a column as numbers; moments and durations in seconds, nan where a cell is empty."""
    cells = np.asarray(values)
    if cells.dtype.kind in "mM":
        start = cells[0] if cells.dtype.kind == "M" else np.timedelta64(0, "ns")
        return np.asarray((cells - start) / np.timedelta64(1, "s"), dtype=float)
    if cells.dtype.kind in "fiub":
        return cells.astype(float)
    out = np.empty(len(cells))
    for row, cell in enumerate(cells):
        if cell is None or (cell != cell) is not False and not isinstance(cell, str | Number):
            out[row] = np.nan  # None, and what pandas has for a missing cell
        elif isinstance(cell, str) or not np.isrealobj(cell) or not isinstance(cell, Number):
            way = 'with decimal=","' if "," in str(cell) else "e.g. by astype(float)"
            raise InputError(
                f"{where}, row {row}: column {name!r} holds {str(cell)[:40]!r}, which is no "
                f"number; convert the column, {way}"
            )
        else:
            out[row] = float(cell)  # type: ignore[arg-type]
    return out


def columns_of_arrays(
    arrays: Mapping[str, ArrayLike | None], name: str
) -> tuple[Any, dict[str, Any]]:
    """One frame of a recording's arrays, and what its columns are, for `toml_of_columns`.

    arrays : time (T,), angle (T,) or (T, n), torque and velocity alike, where there are any;
        torque_time, where the torque has a clock of its own

    Raises
    ------
    InputError
        Where a name is unknown, or lengths and shapes do not fit.
    """
    import pandas as pd  # half a second, which reading files does not need

    where = f"recording {name!r}"
    for key in by_name(arrays, where):
        if key not in _KEYS:
            raise InputError(f"{where}: array {key!r} is unknown; {nearest(key, _KEYS)}")
    parts = {key: _matrix(a, f"{where}, {key}") for key, a in arrays.items() if a is not None}
    for key in ("time", "angle"):
        if key not in parts:
            raise InputError(f"{where}: the array {key!r} is missing; it has {', '.join(parts)}")
    for key, part in parts.items():
        clock = "torque_time" if key == "torque" and "torque_time" in parts else "time"
        if key not in ("time", "torque_time") and len(part) != len(parts[clock]):
            raise InputError(
                f"{where}: {key} has {len(part)} samples and {clock} {len(parts[clock])}; they "
                "must be equally many"
            )
    longest = max(map(len, parts.values()))
    columns: dict[str, Array] = {}
    names: dict[str, Any] = {}
    for key, part in parts.items():
        filled = np.full((longest, part.shape[1]), np.nan)
        filled[: len(part)] = part
        names[key] = [key] if part.shape[1] == 1 else [f"{key} {j + 1}" for j in range(len(part.T))]
        columns |= dict(zip(names[key], filled.T, strict=True))
    clock = "torque_time" if names.pop("torque_time", None) else "time"
    return pd.DataFrame(columns), names | {"time": {"angle": "time", "torque": clock}}


def _matrix(array: ArrayLike, where: str) -> Array:
    """An array (T, n) of numbers."""
    try:
        out = np.asarray(array, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{where}: must be an array of numbers") from None
    out = out[:, None] if out.ndim == 1 else out
    if out.ndim != 2 or not out.size:
        raise InputError(f"{where}: must have shape (T,) or (T, n), not {np.shape(array)}")
    return out
