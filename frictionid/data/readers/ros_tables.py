"""Reader `ros` with [columns]: joint states of one topic or several as a table.

A column is `time`, `position[joint]`, `velocity[joint]` or `effort[joint]` of the topic in
[reader], or stands behind the name of another topic, `/joint_commands/position[joint]`, whose
`/joint_commands/time` is a clock of its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from frictionid.config import Strict, checked
from frictionid.data.readers.column_toml import ColumnNames
from frictionid.data.readers.ros_messages import joint_states, values_of
from frictionid.data.readers.table import Table
from frictionid.errors import InputError

_COLUMN = re.compile(r"(?:(/.+)/)?(?:(time)|(position|velocity|effort)\[(.+)\])")


class RosTableSettings(Strict):
    """Settings of the reader `ros` beside [columns].

    topic : of the joint states, by default the only one; clock : "header" stamps of the messages,
    or when they were "received"
    """

    topic: str = ""
    clock: Literal["header", "received"] = "header"


class Place(NamedTuple):
    """What a column is: topic, "" for that of [reader], and field and joint, "" for its time."""

    topic: str
    field: str
    joint: str


def ros_tables(
    _: bytes, file: str, settings: Mapping[str, Any], columns: ColumnNames
) -> dict[str, Table]:
    """Table of a bag: the rows of one topic after those of another; rows count messages.

    Raises
    ------
    InputError
        For wrong settings and columns, and files that are no bags with these topics and joints.
    """
    given = checked(RosTableSettings, dict(settings), f"{file}: [reader]")
    places = {name: _place(name, file) for name in columns.names()}
    topics = list(dict.fromkeys(place.topic for place in places.values()))
    messages = {t: joint_states(Path(file), t or given.topic, given.clock) for t in topics}
    start = min(own[0][0] for own in messages.values())
    sizes = [len(own) for own in messages.values()]
    ends = dict(zip(topics, np.cumsum(sizes).tolist(), strict=True))
    picked = {}
    for name, place in places.items():
        own = messages[place.topic]
        picked[name] = np.full(sum(sizes), np.nan)
        span = slice(ends[place.topic] - len(own), ends[place.topic])
        if not place.field:  # nanoseconds since 1970 lose digits as floats
            picked[name][span] = [1e-9 * (stamp - start) for stamp, _ in own]
            continue
        values = values_of([message for _, message in own], [place.joint], place.field, file)
        if values is None:
            raise InputError(f"{file}: no message of {name!r} has one; name another topic or field")
        picked[name][span] = values[:, 0]
    return {"": Table(file, np.concatenate([np.arange(size) for size in sizes]), picked)}


def _place(name: str, file: str) -> Place:
    """What the name of a column says.

    >>> _place("/joint_commands/position[elbow]", "a.mcap")
    Place(topic='/joint_commands', field='position', joint='elbow')
    """
    match = _COLUMN.fullmatch(name)
    if match is None:
        raise InputError(
            f"{file}: a bag has no column {name!r}: write time, position[joint], velocity[joint] "
            "or effort[joint], of another topic /topic/position[joint]"
        )
    return Place(match[1] or "", match[3] or "", match[4] or "")
