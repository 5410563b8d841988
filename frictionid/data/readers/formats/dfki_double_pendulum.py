"""Reader `dfki_double_pendulum`: logs of the two-joint arm of [Wiebe2024]."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from frictionid.config import Strict, checked
from frictionid.data.readers.table import read_table, signal_of, table_name
from frictionid.data.recordings import Recording
from frictionid.files import read_bytes


class DoublePendulumSettings(Strict):
    """Settings of the reader `dfki_double_pendulum`.

    torque : "measured", as the drives report it, or "commanded", including the compensation of
        friction
    """

    torque: Literal["measured", "commanded"] = "measured"


def read(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angles and torques of both joints: q1 = 0 hangs down, q2 is relative, torques at the joints.

    The velocities of the file are raw differences with spikes and are not read. Measured torques
    are samples of a varying current and are interpolated; commanded torques are held.
    """
    kind = checked(DoublePendulumSettings, dict(settings), f"{path}: [reader]").torque
    column, hold = {"measured": ("tau_meas", "linear"), "commanded": ("tau_con", "previous")}[kind]
    angle, torque = ["pos_meas1", "pos_meas2"], [f"{column}1", f"{column}2"]
    table = read_table(read_bytes(path), str(path), ["time", *angle, *torque])
    return Recording(
        table_name(path.name),
        signal_of(table, "time", angle),
        signal_of(table, "time", torque, hold=hold),
    )
