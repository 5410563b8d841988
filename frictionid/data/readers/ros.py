"""Reader `ros`: joint states in a ROS 2 bag, an MCAP (.mcap) or SQLite (.db3) file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from frictionid.config import Strict, checked, nearest
from frictionid.data.readers.table import table_name
from frictionid.data.recordings import Recording
from frictionid.data.sample_faults import first_fault
from frictionid.data.signals import Array, Signal
from frictionid.errors import InputError

_KIND = "sensor_msgs/msg/JointState"
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
    if path.suffix not in (".mcap", ".db3"):
        raise InputError(f"{file} is no .mcap or .db3 file; name that of the bag in the patterns")
    stamps, messages = _messages(path, given)
    names = list(given.joints or messages[0].name)
    driven = names if given.driven is None else given.driven
    for name in driven:
        if name not in names:
            raise InputError(
                f"{file}: [reader] driven: {name!r} is no joint; {nearest(name, names)}"
            )
    columns = {field: _column(messages, names, field, file) for field in _FIELDS}
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


def _messages(path: Path, given: RosSettings) -> tuple[Array, list[Any]]:
    """Stamps (T,) [s] since the first, and joint states in the order of the bag."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(
            f"{path}: bags need the package rosbags: pip install 'frictionid[ros]'"
        ) from None
    try:
        store = get_typestore(Stores.ROS2_HUMBLE)
        with AnyReader([path], default_typestore=store) as reader:
            own = _connections(reader.connections, given.topic, path)
            found = list(_stamped(reader, own, given.clock))
    except InputError:
        raise
    except Exception as error:  # whatever rosbags lets through of wrong bytes and lengths
        reason = str(error) or type(error).__name__
        raise InputError(f"{path} is no whole ROS 2 bag ({reason[:80]}); copy it again") from None
    if len(found) < 2:
        raise InputError(f"{path} has {len(found)} joint states; a motion needs more")
    first = found[0][0]
    # nanoseconds since 1970 lose digits as floats: the difference is taken before
    return np.array([1e-9 * (stamp - first) for stamp, _ in found]), [m for _, m in found]


def _connections(connections: Any, topic: str, path: Path) -> list[Any]:
    states = [c for c in connections if c.msgtype == _KIND]
    known = sorted({c.topic for c in states})
    if not known:
        others = sorted({c.topic for c in connections}) or ["none"]
        raise InputError(f"{path} has no topic of {_KIND}; it has {', '.join(others)}")
    if not topic and len(known) > 1:
        raise InputError(f"{path} has the topics {', '.join(known)}: name one by topic in [reader]")
    chosen = topic or known[0]
    if chosen not in known:
        raise InputError(f"{path}: [reader] topic = {topic!r} is unknown; {nearest(topic, known)}")
    return [c for c in states if c.topic == chosen]


def _stamped(reader: Any, own: list[Any], clock: str) -> Iterator[tuple[int, Any]]:
    """Stamp [ns] and message."""
    for connection, received, raw in reader.messages(connections=own):
        message = reader.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp
        yield (received if clock == "received" else stamp.sec * 10**9 + stamp.nanosec), message


def _column(messages: list[Any], names: list[str], field: str, file: str) -> Array | None:
    """Values (T, n) of the joints in order, None where no message has any."""
    if not any(len(getattr(m, field)) for m in messages):
        return None
    out = np.full((len(messages), len(names)), np.nan)
    for k, message in enumerate(messages):
        values, order = getattr(message, field), list(message.name)
        for j, name in enumerate(names):
            if name not in order:
                raise InputError(
                    f"{file}, message {k} (the first is 0) has no joint {name!r}; "
                    f"{nearest(name, order)}"
                )
            at = order.index(name)
            if at < len(values):
                out[k, j] = values[at]
    return out


def _increasing(stamps: Array, file: str) -> Array:
    k = int(np.argmax(np.diff(stamps) <= 0))
    if np.diff(stamps)[k] <= 0:
        raise InputError(
            f"{file}, message {k + 1} (the first is 0): time must increase; try clock = "
            '"received" in [reader]'
        )
    return stamps
