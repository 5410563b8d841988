"""Reader `rtde`: CSV of Universal Robots' Real-Time Data Exchange.

The recorders of [UR-RTDE] and of ur_rtde write one column per joint, from 0, of each field, with
blanks or commas between the cells: timestamp [s since the controller started], actual_q [rad],
actual_qd [rad/s], actual_current [A], and target_moment [N m], which the controller's model of the
arm computes: it is no measurement, and holds no more of the friction than that model.
"""

from collections.abc import Mapping
from typing import Any

from pydantic import NonNegativeInt

from frictionid.config import NonEmpty, Strict, checked

from ..column_toml import ColumnNames
from ..table import Table, read_table

_MOMENT = "target_moment"


class RtdeSettings(Strict):
    """Settings of the reader `rtde`.

    joints : numbers of the mechanism's joints, from 0; velocity : whether actual_qd is read, too
    """

    joints: NonEmpty[NonNegativeInt] = [0, 1, 2, 3, 4, 5]
    velocity: bool = False


def tables(
    content: bytes, file: str, settings: Mapping[str, Any], columns: ColumnNames
) -> dict[str, Table]:
    """Table of a recording."""
    checked(RtdeSettings, settings, f"{file}: [reader]")
    return {"": read_table(content, file, columns.names())}


def defaults(document: dict[str, Any]) -> dict[str, Any]:
    """A dataset.toml with [columns], and that moments are commands, where it does not say so.

    Torques are actual_current where [units] says that they are currents, else target_moment.
    """
    settings = {key: value for key, value in document["reader"].items() if key != "kind"}
    if "columns" not in document:
        chosen = checked(RtdeSettings, settings, "[reader]")
        units = document.get("units")
        unit = str(units.get("torque", "N m")) if isinstance(units, dict) else "N m"
        torque = _MOMENT if unit.endswith("m") else "actual_current"
        fields = {"angle": "actual_q", "torque": torque}
        fields |= {"velocity": "actual_qd"} if chosen.velocity else {}
        names = {key: [f"{field}_{j}" for j in chosen.joints] for key, field in fields.items()}
        document = {**document, "columns": {"time": "timestamp", **names}}
    columns = document["columns"]
    named = columns.get("torque", "") if isinstance(columns, dict) else ""
    torques = named if isinstance(named, list) else [named]
    if "torque" not in document and any(str(name).startswith(_MOMENT) for name in torques):
        document = {**document, "torque": {"at": "command"}}
    return document
