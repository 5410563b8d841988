"""Formats of tables that need more than names of columns; [columns], [units], [motor] stay."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from frictionid.data.readers.column_toml import ColumnNames
from frictionid.data.readers.drive_recorder import drive_recorder_tables, object_units
from frictionid.data.readers.lerobot import lerobot_tables, lerobot_units
from frictionid.data.readers.ros_tables import ros_tables
from frictionid.data.readers.rtde import rtde_columns, rtde_tables
from frictionid.data.readers.table import Table


class TableFormat(NamedTuple):
    """How a format becomes tables of named columns.

    tables : of content, name of the file, settings in [reader] and [columns]; each with what its
        recording's name has behind that of the file
    unstated : quantities whose unit no name says, columns of these, and why it must be stated
    defaults : the document of a dataset.toml with what the format says of itself
    needs_columns : whether [columns] must be there; else a reader in READERS does without
    """

    tables: Callable[[bytes, str, Mapping[str, Any], ColumnNames], dict[str, Table]]
    unstated: Callable[[ColumnNames], Iterator[tuple[str, str, str]]] = lambda _: iter(())
    defaults: Callable[[dict[str, Any]], dict[str, Any]] = lambda document: document
    needs_columns: bool = True


TABLE_FORMATS: Mapping[str, TableFormat] = {
    "drive_recorder": TableFormat(drive_recorder_tables, object_units),
    "lerobot": TableFormat(lerobot_tables, lerobot_units),
    "ros": TableFormat(ros_tables, needs_columns=False),
    "rtde": TableFormat(rtde_tables, defaults=rtde_columns),
}


def with_defaults(document: dict[str, Any]) -> dict[str, Any]:
    """A dataset.toml with what the format of its tables says of itself.

    >>> with_defaults({"reader": {"kind": "rtde", "joints": [5]}})["columns"]["angle"]
    ['actual_q_5']
    """
    reader = document.get("reader")
    kind = reader.get("kind") if isinstance(reader, dict) else None
    known = isinstance(kind, str) and kind in TABLE_FORMATS
    return TABLE_FORMATS[str(kind)].defaults(document) if known else document
