"""Reader `dfki_simple_pendulum`: logs of the one-joint arm of [Wiebe2024]."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from frictionid.config import Strict, checked
from frictionid.data.readers.table import read_table, signal_of, table_name
from frictionid.data.recordings import Recording
from frictionid.files import read_bytes


class SimplePendulumSettings(Strict):
    """Settings of the reader `dfki_simple_pendulum`.

    torque : between two samples: "linear" for measured torques, "previous" for held commands
    """

    torque: Literal["linear", "previous"] = "linear"


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angle, velocity and torque of one joint; 0 hangs down, all in SI units."""
    hold = checked(SimplePendulumSettings, dict(settings), f"{path}: [reader]").torque
    names = ["time", "position", "velocity", "torque"]
    table = read_table(read_bytes(path), str(path), names)
    return Recording(
        table_name(path.name),
        signal_of(table, "time", ["position"]),
        signal_of(table, "time", ["torque"], hold=hold),
        velocity=signal_of(table, "time", ["velocity"]),
    )
