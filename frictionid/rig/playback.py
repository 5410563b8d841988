"""Playing a torque signal to a drive: limits, ramps, a watchdog, and an emergency stop."""

import contextlib
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from frictionid.arrays import usual_step
from frictionid.config import Positive, validated
from frictionid.data.readers.table import read_table, signal_of
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Array, Signal, sample
from frictionid.errors import InputError
from frictionid.files import read_bytes

from .log import Logger
from .logfile import column_names
from .rig_settings import Cells, RigSettings

_PUMP = 0.05  # [s], longest wait for a line
_REPEATS = 3  # of a stop command: a line may be damaged
_OVERLOAD = 1.5  # times the limit: a larger measured torque stops at once


@validated
class PlaySettings:
    """How a signal is played.

    Attributes
    ----------
    rate : commands per second [Hz]
    ramp : [s], from zero torque to the signal and back
    silence : [s] without a line from the drive, after which the torque is ramped down
    """

    rate: Positive = 100.0
    ramp: Positive = 0.3
    silence: Positive = 0.25


def load_signal(path: Path, rig: RigSettings) -> Signal:
    """Torque signal of a table: time [s] and one column per motor [N m], held.

    Raises
    ------
    InputError
        Where columns do not fit, or a torque exceeds the limit of its motor.
    """
    content = read_bytes(path)
    header = column_names(content)
    names = [h for h in header if h != "time"]
    if "time" not in header or len(names) != len(rig.motors):
        raise InputError(
            f"{path} has the columns {', '.join(header)}; a signal for {len(rig.motors)} motors "
            "has time and one torque for each"
        )
    table = read_table(content, str(path), ["time", *names])
    count = len(table.rows)
    if count < 2:
        raise InputError(f"{path} has {count} rows; a signal ends with a second row at least")
    torque = signal_of(table, "time", names, hold="previous")
    for motor, column, name in zip(rig.motors, torque.value.T, names, strict=True):
        if motor.limit is None:
            raise InputError(
                f"{rig.file}: [motor] has no limit: add limit = the largest torque [N m] that is "
                "safe at the joint"
            )
        k = int(np.argmax(np.abs(column)))
        if abs(column[k]) > motor.limit:
            raise InputError(
                f"{path}, row {table.rows[k]}: {name} = {column[k]:g} N m exceeds the limit of "
                f"{motor.limit:g} N m; make the signal smaller"
            )
    return torque._replace(time=torque.time - torque.time[0])


def torque_of(dataset: Dataset, name: str = "") -> Signal:
    """Torque of the driven joints of a recording, by default the first one, on the angles' span."""
    recording = dataset[name] if name else dataset.recordings[0]
    driven = np.array(dataset.mechanism.driven)
    torque, last = recording.torque, float(recording.angle.time[-1])
    time, value = torque.time, torque.value[:, driven]
    if last > time[-1]:
        time, value = np.append(time, last), np.concatenate([value, value[-1:]])
    return Signal(time, value, torque.hold)


def excite(logger: Logger, signal: Signal, settings: PlaySettings, stop: Callable[[], str]) -> str:
    """Play a signal while logging; the reason why it ended early, "" where it did not.

    stop : reason to stop at once, "" while there is none; "ramp" ramps the torque down first

    Whatever happens, the last that the drive receives is zero torque and its stop command.
    """
    end = time.monotonic() + max(4 * settings.silence, 1.0)
    try:
        while not logger.pump(_PUMP):
            if time.monotonic() > end:
                raise InputError(
                    "the drive is silent: nothing is played to a drive that does not report"
                )
        return _played(logger, signal, settings, stop)
    finally:
        for _ in range(_REPEATS):
            _command(logger, np.zeros(len(logger.rig.motors)))
            logger.send(logger.rig.protocol.stop)
        logger.pump(_PUMP)


def _played(logger: Logger, signal: Signal, settings: PlaySettings, stop: Callable[[], str]) -> str:
    """Send commands until the signal and the ramp down are over, or something stops them.

    The torque is the signal times an envelope: up within the ramp, down from `ramp_down` on.
    """
    length = float(signal.time[-1]) + usual_step(signal.time)
    start = heard = time.monotonic()
    reason, ramp_down, count = "", float("inf"), 0
    while (now := time.monotonic() - start) < min(length, ramp_down) + settings.ramp:
        if now >= length:
            ramp_down = min(ramp_down, now)
        envelope = np.clip((ramp_down + settings.ramp - now) / settings.ramp, 0.0, 1.0)
        envelope = min(float(envelope), now / settings.ramp)
        _command(logger, envelope * sample(signal, [min(now, length)])[0])
        count += 1
        due = start + count / settings.rate
        rows = logger.pump(max(min(due - time.monotonic(), _PUMP), 0.0))
        heard = time.monotonic() if rows else heard
        asked = stop()
        emergency = _overload(logger.rig, rows) if asked in ("", "ramp") else asked
        if emergency:
            return emergency
        if not np.isfinite(ramp_down):
            silent = time.monotonic() - heard > settings.silence or not logger.connected
            if asked or silent:
                ramp_down = time.monotonic() - start
                reason = "the drive fell silent" if silent else "stopped on request"
    return reason


def _command(logger: Logger, torque: Array) -> None:
    """Send torques [N m] of the joints, clipped to the limits, in the unit of the commands."""
    values = [
        float(np.clip(u, -(m.limit or 0.0), m.limit or 0.0)) / m.per_command
        for u, m in zip(torque, logger.rig.motors, strict=True)
    ]
    text = ",".join(f"{v:.6f}" for v in values)
    logger.send(logger.rig.protocol.send.replace("{value}", text))


def _overload(rig: RigSettings, rows: list[Cells]) -> str:
    """Message about a measured torque far beyond its limit, "" where there is none."""
    for cells in rows:
        values = dict(zip(rig.protocol.columns, cells, strict=True))
        for motor in rig.motors:
            torque = motor.per_measured * float(values[motor.measured])
            if abs(torque) > _OVERLOAD * (motor.limit or np.inf):
                return (
                    f"the drive reports {torque:.3g} N m, beyond its limit of {motor.limit:g} N m"
                )
    return ""


@contextlib.contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """The key that was pressed, "" where none was; keys are not echoed meanwhile."""
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    tty.setcbreak(handle)
    try:
        yield lambda: _key(handle)
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)


def _key(handle: int) -> str:
    if not select.select([handle], [], [], 0.0)[0]:
        return ""
    return os.read(handle, 1).decode("latin-1") or ""
