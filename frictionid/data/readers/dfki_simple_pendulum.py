"""Reader `dfki_simple_pendulum`: logs of the torque-limited pendulum of [Wiebe2022]."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from frictionid.config import Strict, checked
from frictionid.data.readers.table import read_table, table_name
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.recordings import Recording
from frictionid.files import read_bytes


class SimplePendulumSettings(Strict):
    """Settings of the reader `dfki_simple_pendulum`.

    torque : between two samples: "linear" for measured torques, "previous" for held commands
    """

    torque: Literal["linear", "previous"] = "linear"


def read_dfki_simple_pendulum(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angle, velocity and torque of one joint; 0 hangs down, all in SI units."""
    given = checked(SimplePendulumSettings, dict(settings), f"{path}: [reader]")
    names = ["time", "position", "velocity", "torque"]
    table = read_table(read_bytes(path), str(path), names)
    return Recording(
        table_name(path.name),
        signal_of(table, "time", ["position"]),
        signal_of(table, "time", ["torque"], hold=given.torque),
        velocity=signal_of(table, "time", ["velocity"]),
    )
