"""Playing a torque signal to a drive: limits, ramps, silence, and an emergency stop."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from frictionid.acquire.log import Counts, Logger
from frictionid.acquire.rig_settings import RigSettings
from frictionid.data.readers.table import content_of, read_table
from frictionid.data.recordings import first_fault
from frictionid.data.signals import Array, Signal, sample
from frictionid.errors import InputError

_PUMP = 0.05  # [s], longest wait for a line
_AGAIN = 3  # times that a stop is sent: a line may be damaged
_OVER = 1.5  # of the limit: a measured torque beyond it stops everything


@dataclass(frozen=True)
class Playing:
    """How a signal is played.

    rate : commands per second [Hz]; ramp : [s] down to nothing, and up to the first value
    silence : [s] without a line from the drive, after which the torque goes down
    """

    rate: float = 100.0
    ramp: float = 0.3
    silence: float = 0.25

    def __post_init__(self) -> None:
        for name in ("rate", "ramp", "silence"):
            if not 0 < getattr(self, name) < float("inf"):
                raise InputError(f"{name} = {getattr(self, name)} must be positive and finite")


def load_signal(path: Path, setup: RigSettings) -> Signal:
    """Torque signal of a table: time [s] and one column per motor [N m], held.

    Raises
    ------
    InputError
        Where columns do not fit, or a torque exceeds its motor's limit.
    """
    content = content_of(path)
    header = content.partition(b"\n")[0].decode("utf-8", "replace").strip().split(",")
    names = [h for h in header if h != "time"]
    if "time" not in header or len(names) != len(setup.motors):
        raise InputError(
            f"{path} has the columns {', '.join(header)}; a signal for {len(setup.motors)} motors "
            "has time and one torque for each"
        )
    table = read_table(content, str(path), ["time", *names])
    time_ = table.columns["time"]
    value = np.stack([table.columns[n] for n in names], axis=1)
    if len(time_) < 2:
        raise InputError(f"{path} has {len(time_)} rows; a signal ends with a second row at least")
    fault = first_fault(time_, value, ("time", *names))
    if fault:
        raise InputError(f"{path}, row {table.rows[fault[0]]}: {fault[1]}; repair or delete it")
    for motor, column, name in zip(setup.motors, value.T, names, strict=True):
        if motor.limit is None:
            raise InputError(
                f"{setup.file}: [motor] has no limit: add limit = the largest torque [N m] that is "
                "safe at the joint"
            )
        k = int(np.argmax(np.abs(column)))
        if abs(column[k]) > motor.limit:
            raise InputError(
                f"{path}, row {table.rows[k]}: {name} = {column[k]:g} N m exceeds the limit of "
                f"{motor.limit:g} N m; make the signal smaller"
            )
    return Signal(time_ - time_[0], value, "previous")


def excite(
    logger: Logger,
    signal: Signal,
    setup: RigSettings,
    playing: Playing,
    stop: Callable[[], str],
    show: Callable[[Counts, bool], None],
) -> str:
    """Play a signal and log meanwhile; why it ended, "" where the signal was over.

    stop : why everything must end at once, "" while nothing must. A request "ramp" lets the torque
        go down within the ramp.

    Whatever happens the last that the drive hears is its stop command.
    """
    reason = ""
    try:
        # nothing is played to a drive that does not answer
        _wait(logger, playing, show)
        reason = _played(logger, signal, setup, playing, stop, show)
    finally:
        for _ in range(_AGAIN):
            _order(logger, setup, np.zeros(len(setup.motors)))
            logger.send(setup.protocol.stop)
        logger.pump(_PUMP)
    return reason


def _wait(logger: Logger, playing: Playing, show: Callable[[Counts, bool], None]) -> None:
    end = time.monotonic() + max(4 * playing.silence, 1.0)
    while not logger.pump(_PUMP):
        show(logger.counts, logger.connected)
        if time.monotonic() > end:
            raise InputError("the drive says nothing: nothing is played to a drive that is silent")


def _played(
    logger: Logger,
    signal: Signal,
    setup: RigSettings,
    playing: Playing,
    stop: Callable[[], str],
    show: Callable[[Counts, bool], None],
) -> str:
    length = float(signal.time[-1]) + float(np.median(np.diff(signal.time)))
    start = heard = time.monotonic()
    reason, down = "", float("inf")
    number = 0
    while True:
        now = time.monotonic() - start
        share = float(np.clip((down + playing.ramp - now) / playing.ramp, 0.0, 1.0))
        share = min(share, now / playing.ramp)
        if now >= min(length, down) + playing.ramp:
            return reason
        if now >= length and not np.isfinite(down):
            down = now
        _order(logger, setup, share * sample(signal, [min(now, length)])[0])
        number += 1
        rows = logger.pump(max(min(start + number / playing.rate - time.monotonic(), _PUMP), 0.0))
        show(logger.counts, logger.connected)
        heard = time.monotonic() if rows else heard
        asked = stop()
        if asked and asked != "ramp":
            return asked
        too_much = _too_much(setup, rows)
        if too_much:
            return too_much
        if not np.isfinite(down):
            silent = time.monotonic() - heard > playing.silence or not logger.connected
            if asked or silent:
                down = time.monotonic() - start
                reason = "the drive fell silent" if silent else "stopped on request"


def _order(logger: Logger, setup: RigSettings, torque: Array) -> None:
    values = [
        float(np.clip(u, -(m.limit or 0.0), m.limit or 0.0)) / m.per_command
        for u, m in zip(torque, setup.motors, strict=True)
    ]
    text = ",".join(f"{v:.6f}" for v in values)
    logger.send(setup.protocol.send.replace("{value}", text))


def _too_much(setup: RigSettings, rows: list[tuple[bytes, ...]]) -> str:
    """What to say of a measured torque far beyond its limit."""
    for cells in rows:
        values = dict(zip(setup.protocol.columns, cells, strict=True))
        for motor in setup.motors:
            torque = motor.per_measured * float(values[motor.measured])
            if abs(torque) > _OVER * (motor.limit or np.inf):
                return (
                    f"the drive reports {torque:.3g} N m, beyond its limit of {motor.limit:g} N m"
                )
    return ""


@contextlib.contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """The key that was pressed, "" where none was; nothing is echoed meanwhile."""
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
