"""Which columns of a table are of an IMU on a base that moves, and in which units."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.readers.table import Table

from .column_names import is_measured, words

_CALLED = {
    "angular_velocity": (
        frozenset("gyro gyroscope gyr gx gy gz wx wy wz".split()),
        (frozenset({"angular", "velocity"}), frozenset({"angular", "vel"})),
    ),
    "specific_force": (
        frozenset("acc accel accelerometer ax ay az".split()),
        (frozenset({"linear", "acceleration"}), frozenset({"specific", "force"})),
    ),
}
_IN_G = (0.5, 2.0)  # median size of a specific force in units of g
_FAST = 35.0  # [rad/s]: gyroscopes show less, unless it is deg/s


def imu_columns(table: Table) -> dict[str, Any]:
    """The [base] table of an IMU whose columns have usual names, or nothing.

    >>> names = [f"imu_{kind}_{axis}" for kind in ("gyro", "acc") for axis in "xyz"]
    >>> base = imu_columns(Table("a.csv", np.arange(2), {name: np.ones(2) for name in names}))
    >>> base["angular_velocity"], base["units"]
    (['imu_gyro_x', 'imu_gyro_y', 'imu_gyro_z'], {'specific_force': 'g'})
    >>> sorted(names_of(base)) == sorted(names)
    True
    """
    out: dict[str, Any] = {}
    for quantity in _CALLED:
        names = list(_columns(table, quantity))
        if len(names) != 3:
            return {}
        out[quantity] = names
    units = {}
    if _size(table, out["angular_velocity"]).max() > _FAST:
        units["angular_velocity"] = "deg/s"
    if _IN_G[0] < np.median(_size(table, out["specific_force"])) < _IN_G[1]:
        units["specific_force"] = "g"
    at_origin = {key: [0.0, 0.0, 0.0] for key in ("sensor_position", "sensor_rotation")}
    return {**out, **({"units": units} if units else {}), **at_origin}


def names_of(base: Mapping[str, Any]) -> list[str]:
    """Columns of an IMU."""
    return [name for quantity in _CALLED for name in base.get(quantity, ())]


def _columns(table: Table, quantity: str) -> Iterator[str]:
    single, several = _CALLED[quantity]
    for name in table.columns:
        said = set(words(name))
        if is_measured(name) and (said & single or any(each <= said for each in several)):
            yield name


def _size(table: Table, names: list[str]) -> Array:
    """Length (T,) of vectors where all their columns have numbers."""
    vectors = np.stack([table.columns[name] for name in names])
    return np.asarray(np.linalg.norm(vectors[:, np.isfinite(vectors).all(axis=0)], axis=0))
