"""Reader `dfki_double_pendulum`: logs of the two-joint arm of [Wiebe2024]."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from frictionid.config import Strict, checked
from frictionid.data.readers.table import read_table, table_name
from frictionid.data.readers.table_signals import signal_of
from frictionid.data.recordings import Recording
from frictionid.files import read_bytes


class DoublePendulumSettings(Strict):
    """Settings of the reader `dfki_double_pendulum`.

    torque : "measured", as the drives report it, or "commanded", including the compensation of
        friction
    """

    torque: Literal["measured", "commanded"] = "measured"


def read_dfki_double_pendulum(path: Path, settings: Mapping[str, Any]) -> Recording:
    """Angles and torques of both joints: q1 = 0 hangs down, q2 is relative, torques at the joints.

    The velocities of the file are raw differences with spikes and are not read. Measured torques
    are samples of a varying current and are interpolated; commanded torques are held.
    """
    given = checked(DoublePendulumSettings, dict(settings), f"{path}: [reader]")
    measured = given.torque == "measured"
    angle = ["pos_meas1", "pos_meas2"]
    torque = [f"tau_{'meas' if measured else 'con'}{joint}" for joint in (1, 2)]
    table = read_table(read_bytes(path), str(path), ["time", *angle, *torque])
    return Recording(
        table_name(path.name),
        signal_of(table, "time", angle),
        signal_of(table, "time", torque, hold="linear" if measured else "previous"),
    )


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
