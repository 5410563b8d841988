"""Joint states in a ROS 2 bag, an MCAP (.mcap) or SQLite (.db3) file, topic by topic."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.config import nearest
from frictionid.data.signals import Array
from frictionid.errors import InputError

_KIND = "sensor_msgs/msg/JointState"


def joint_states(path: Path, topic: str, clock: str) -> list[tuple[int, Any]]:
    """Stamps [ns] and joint states of a topic, "" the only one, in the order of the bag.

    Raises
    ------
    InputError
        Without the package rosbags, for files that are no bags, and bags without the topic.
    """
    if path.suffix not in (".mcap", ".db3"):
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
            wanted = _connections(reader.connections, topic, path)
            states = list(_stamped(reader, wanted, clock))
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


def _stamped(reader: Any, connections: list[Any], clock: str) -> Iterator[tuple[int, Any]]:
    """Stamp [ns] and message."""
    for connection, received, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp
        yield (received if clock == "received" else stamp.sec * 10**9 + stamp.nanosec), message


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
