"""Reader `ros`: joint states in a ROS 2 bag, an MCAP (.mcap) or SQLite (.db3) file.

With [columns], a column is `time`, `position[joint]`, `velocity[joint]` or `effort[joint]` of the
topic in [reader], or stands behind the name of another topic, `/joint_commands/position[joint]`,
whose `/joint_commands/time` is a clock of its own.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from frictionid.config import Strict, checked, nearest
from frictionid.errors import InputError
from frictionid.files import BAGS

from ...recordings import Recording
from ...signals import Array, Signal, first_fault
from ..column_toml import ColumnNames
from ..table import Table, table_name

_KIND = "sensor_msgs/msg/JointState"
_FIELDS = ("position", "velocity", "effort")
_COLUMN = re.compile(r"(?:(/.+)/)?(?:(time)|(position|velocity|effort)\[(.+)\])")


class RosTableSettings(Strict):
    """Settings of the reader `ros` beside [columns].

    topic : of the joint states, by default the only one; clock : "header" stamps of the messages,
    or when they were "received"
    """

    topic: str = ""
    clock: Literal["header", "received"] = "header"


class RosSettings(RosTableSettings):
    """Settings of the reader `ros` without [columns].

    joints : names in the mechanism's order, by default all in that of the first message; driven :
    names of those whose effort is a torque, by default all; hold : what efforts do between two
    messages, as any torque's by default
    """

    joints: list[str] | None = None
    driven: list[str] | None = None
    hold: Literal["linear", "previous"] | None = None


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Positions, velocities where there are any, and efforts of the joints; SI units, as in ROS.

    Time counts from the first message.
    """
    chosen = checked(RosSettings, settings, f"{path}: [reader]")
    file = str(path)
    stamped = joint_states(path, chosen.topic, chosen.clock)
    # nanoseconds since 1970 lose digits as floats: the difference is taken before
    stamps = np.array([1e-9 * (stamp - stamped[0][0]) for stamp, _ in stamped])
    messages = [message for _, message in stamped]
    names = list(chosen.joints or messages[0].name)
    driven = names if chosen.driven is None else chosen.driven
    for name in driven:
        if name not in names:
            raise InputError(
                f"{file}: [reader] driven: {name!r} is no joint; {nearest(name, names)}"
            )
    q, w, u = (values_of(messages, names, field, file) for field in _FIELDS)
    if q is None:
        raise InputError(f"{file}: the joint states have no position; record another topic")
    if u is None and driven:
        raise InputError(
            f"{file}: the joint states have no effort; without motors set driven = [] in [reader]"
        )
    back = np.flatnonzero(np.diff(stamps) <= 0)
    if len(back):
        raise InputError(
            f"{file}, message {back[0] + 1} (the first is 0): time must increase; try clock = "
            '"received" in [reader]'
        )
    torque = 0.0 * q if u is None else np.where([name in driven for name in names], u, 0.0)
    parts = {"position": q, "effort": torque} | ({} if w is None else {"velocity": w})
    labels = [f"{what} of {name}" for what in parts for name in names]
    fault = first_fault(stamps, np.hstack([*parts.values()]), ("time", *labels))
    if fault:
        raise InputError(f"{file}, message {fault[0]} (the first is 0): {fault[1]}")
    return Recording(
        table_name(path.name),
        Signal(stamps, q),
        Signal(stamps, torque, chosen.hold),
        velocity=None if w is None else Signal(stamps, w),
    )


def tables(
    _: bytes, file: str, settings: Mapping[str, Any], columns: ColumnNames
) -> dict[str, Table]:
    """Table of a bag: the rows of one topic after those of another; rows count messages."""
    chosen = checked(RosTableSettings, settings, f"{file}: [reader]")
    return {"": _table(file, chosen, columns.names())}


def numeric_table(path: Path) -> Table:
    """Table with all columns of the joint states of a bag that has one topic of them."""
    first = joint_states(path, "", "header")[0][1]
    fields = [field for field in _FIELDS if len(getattr(first, field))]
    names = [f"{field}[{joint}]" for field in fields for joint in first.name]
    return _table(str(path), RosTableSettings(), ["time", *names])


def _table(file: str, chosen: RosTableSettings, names: Sequence[str]) -> Table:
    places = {name: _place(name, file) for name in names}
    topics = list(dict.fromkeys(topic for topic, _, _ in places.values()))
    messages = {t: joint_states(Path(file), t or chosen.topic, chosen.clock) for t in topics}
    start = min(states[0][0] for states in messages.values())
    sizes = [len(states) for states in messages.values()]
    ends = dict(zip(topics, np.cumsum(sizes).tolist(), strict=True))
    picked = {}
    for name, (topic, field, joint) in places.items():
        states = messages[topic]
        picked[name] = np.full(sum(sizes), np.nan)
        span = slice(ends[topic] - len(states), ends[topic])
        if not field:  # nanoseconds since 1970 lose digits as floats
            picked[name][span] = [1e-9 * (stamp - start) for stamp, _ in states]
            continue
        values = values_of([message for _, message in states], [joint], field, file)
        if values is None:
            raise InputError(f"{file}: no message of {name!r} has one; name another topic or field")
        picked[name][span] = values[:, 0]
    return Table(file, np.concatenate([np.arange(size) for size in sizes]), picked)


def _place(name: str, file: str) -> tuple[str, str, str]:
    """What a column is: topic, "" for that of [reader], and field and joint, "" for its time.

    >>> _place("/joint_commands/position[elbow]", "a.mcap")
    ('/joint_commands', 'position', 'elbow')
    """
    match = _COLUMN.fullmatch(name)
    if match is None:
        raise InputError(
            f"{file}: a bag has no column {name!r}: write time, position[joint], velocity[joint] "
            "or effort[joint], of another topic /topic/position[joint]"
        )
    return match[1] or "", match[3] or "", match[4] or ""


def joint_states(path: Path, topic: str, clock: str) -> list[tuple[int, Any]]:
    """Stamps [ns] and joint states of a topic, "" the only one, in the order of the bag.

    Raises
    ------
    InputError
        Without the package rosbags, for files that are no bags, and bags without the topic.
    """
    if path.suffix not in BAGS:
        raise InputError(f"{path} is no .mcap or .db3 file; name that of the bag in the patterns")
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
            wanted, states = _connections(reader.connections, topic, path), []
            for connection, received, raw in reader.messages(connections=wanted):
                message = reader.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp
                sent = stamp.sec * 10**9 + stamp.nanosec
                states.append((received if clock == "received" else sent, message))
    except InputError:
        raise
    except Exception as error:  # whatever rosbags lets through of wrong bytes and lengths
        reason = str(error) or type(error).__name__
        raise InputError(f"{path} is no whole ROS 2 bag ({reason[:80]}); copy it again") from None
    if len(states) < 2:
        raise InputError(f"{path} has {len(states)} joint states; a motion needs more")
    return states


def _connections(connections: Any, topic: str, path: Path) -> list[Any]:
    states = [c for c in connections if c.msgtype == _KIND]
    topics = sorted({c.topic for c in states})
    if not topics:
        others = sorted({c.topic for c in connections}) or ["none"]
        raise InputError(f"{path} has no topic of {_KIND}; it has {', '.join(others)}")
    if not topic and len(topics) > 1:
        raise InputError(
            f"{path} has the topics {', '.join(topics)}: name one by topic in [reader]"
        )
    chosen = topic or topics[0]
    if chosen not in topics:
        raise InputError(f"{path}: [reader] topic = {topic!r} is unknown; {nearest(topic, topics)}")
    return [c for c in states if c.topic == chosen]


def values_of(messages: list[Any], names: list[str], field: str, file: str) -> Array | None:
    """Values (T, n) of the joints in order, None where no message has any.

    Raises
    ------
    InputError
        Where a message lacks a joint.
    """
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
