"""Reader `ros`: joint states in a ROS 2 bag, an MCAP (.mcap) or SQLite (.db3) file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from frictionid.config import Strict, checked, nearest
from frictionid.data.readers.ros_messages import joint_states, values_of
from frictionid.data.readers.table import table_name
from frictionid.data.recordings import Recording
from frictionid.data.signal_checks import first_fault
from frictionid.data.signals import Array, Signal
from frictionid.errors import InputError

_FIELDS = ("position", "velocity", "effort")


class RosSettings(Strict):
    """Settings of the reader `ros`.

    topic : of the joint states, by default the only one; joints : names in the mechanism's order,
    by default all in that of the first message; driven : names of those whose effort is a torque,
    by default all; clock : "header" stamps of the messages, or when they were "received"
    hold : what efforts do between two messages, as any torque's by default
    """

    topic: str = ""
    joints: list[str] | None = None
    driven: list[str] | None = None
    clock: Literal["header", "received"] = "header"
    hold: Literal["linear", "previous"] | None = None


def read_ros(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Positions, velocities where there are any, and efforts of the joints; SI units, as in ROS.

    Time counts from the first message.

    Raises
    ------
    InputError
        Without the package rosbags, for wrong settings, files that are no bags, and messages
        without the joints.
    """
    given = checked(RosSettings, dict(settings), f"{path}: [reader]")
    file = str(path)
    found = joint_states(path, given.topic, given.clock)
    # nanoseconds since 1970 lose digits as floats: the difference is taken before
    stamps = np.array([1e-9 * (stamp - found[0][0]) for stamp, _ in found])
    messages = [message for _, message in found]
    names = list(given.joints or messages[0].name)
    driven = names if given.driven is None else given.driven
    for name in driven:
        if name not in names:
            raise InputError(
                f"{file}: [reader] driven: {name!r} is no joint; {nearest(name, names)}"
            )
    columns = {field: values_of(messages, names, field, file) for field in _FIELDS}
    q, w, u = (columns[field] for field in _FIELDS)
    if q is None:
        raise InputError(f"{file}: the joint states have no position; record another topic")
    if u is None and driven:
        raise InputError(
            f"{file}: the joint states have no effort; without motors set driven = [] in [reader]"
        )
    time = _increasing(stamps, file)
    torque = np.zeros_like(q)
    for j, name in enumerate(names):
        if u is not None and name in driven:
            torque[:, j] = u[:, j]
    parts = [part for part in (q, torque, w) if part is not None]
    fault = first_fault(time, np.concatenate(parts, axis=1), ("time", *_labels(names, len(parts))))
    if fault:
        raise InputError(f"{file}, message {fault[0]} (the first is 0): {fault[1]}")
    return Recording(
        table_name(path.name),
        Signal(time, q),
        Signal(time, torque, given.hold),
        velocity=None if w is None else Signal(time, w),
    )


def _labels(names: list[str], parts: int) -> list[str]:
    return [
        f"{what} of {name}" for what in ("position", "effort", "velocity")[:parts] for name in names
    ]


def _increasing(stamps: Array, file: str) -> Array:
    k = int(np.argmax(np.diff(stamps) <= 0))
    if np.diff(stamps)[k] <= 0:
        raise InputError(
            f"{file}, message {k + 1} (the first is 0): time must increase; try clock = "
            '"received" in [reader]'
        )
    return stamps
