"""What tests of the drive share: rigs, ports that are pseudo-terminals, and a drive that floods.

As a script it is that drive (`flood`), or a logger that is killed again and again (`kill`).
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

from frictionid.acquire.drive import Drive, Faults
from frictionid.acquire.log import Logger
from frictionid.acquire.logfile import Appender, Layout
from frictionid.acquire.playing import play, plugged
from frictionid.acquire.port import Port
from frictionid.acquire.protocol import written
from frictionid.acquire.settings import Setup, setup_of
from frictionid.acquire.terminal import Terminal
from frictionid.signals import Signal

PATIENCE = 60.0  # [s] until a test gives up waiting for something that must happen
WIRE = {"checksum": "crc16", "mark": "$", "begin": "start"}
MOTOR = {"kt": 0.0136, "gear": 18.0, "limit": 0.5}


def setup(**wire: object) -> Setup:
    """Settings of a rig with one motor."""
    return setup_of({"motor": MOTOR, "protocol": {**WIRE, **wire}}, "rig.toml")


def logger(port: Path, out: Path, made: Setup, *, more: bool = False) -> Logger:
    """A logger of a port."""
    layout = Layout(made)
    return Logger(partial(Port, str(port), 115200), layout, Appender(out, layout.header, more=more))


def until(what, timeout: float = PATIENCE) -> None:
    """Wait for something that must come true."""
    end = time.monotonic() + timeout
    while not what():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.001)


class Rows:
    """Number of whole rows below the header of a growing file."""

    def __init__(self, path: Path) -> None:
        self._path, self._at, self._lines = path, 0, 0

    def __call__(self) -> int:
        if self._path.exists():
            with self._path.open("rb") as file:
                file.seek(self._at)
                new = file.read()
            self._at += len(new)
            self._lines += new.count(b"\n")
        return max(self._lines - 1, 0)


def _logged(rows: Rows, count: int) -> bool:
    return rows() >= count


def flood(folder: Path, lines: int, damaged: float, unplugged: int) -> None:
    """Play lines as fast as they are read, and pull the cable when all before has been logged."""
    time_ = np.arange(2) * (lines - 1) / 1000.0
    drive = Drive(
        setup(),
        Signal(time_, np.array([[0.1], [0.2]])),
        faults=Faults(damaged, unplugged, seed=7),
    )
    rows, sent = Rows(folder / "log.csv"), Rows(folder / "sent.txt")
    with (folder / "sent.txt").open("wb") as file, plugged(Terminal(folder / "port")) as terminal:
        play(
            drive,
            terminal,
            speed=float("inf"),
            sent=file,
            before_unplug=lambda: until(lambda: rows() >= sent() + 1),
        )


def kill(folder: Path, times: int, seed: int) -> None:
    """Kill loggers at random moments; prints what was sent and logged each time."""
    generator, told = np.random.default_rng(seed), []
    made = setup()
    form = made.wire.format()
    for number in range(times):
        out = folder / f"{number}.csv"
        terminal = Terminal(folder / f"port{number}")
        child = os.fork()
        if not child:
            log = logger(terminal.link, out, made)
            while True:
                log.pump(1.0)
        rows, sent = Rows(out), 0
        most = int(generator.integers(1, 3000))
        until(partial(terminal.heard, 0.1))
        while sent < most:
            batch = min(int(generator.integers(1, 200)), most - sent)
            content = b"".join(
                written(form, (str(1000 * (sent + i)), "0.1", "0.2")) for i in range(batch)
            )
            while content:
                content = content[terminal.send(content, 1.0) :]
            sent += batch
            # as a drive of 1 kHz would be at most half a second ahead
            until(partial(_logged, rows, max(sent - 500, 1)))
        until_ = time.perf_counter() + generator.uniform(0.0, 0.002)
        while time.perf_counter() < until_:
            pass
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        terminal.unplug()
        told.append({"file": str(out), "sent": sent})
    print(json.dumps(told))


if __name__ == "__main__":
    if sys.argv[1] == "flood":
        flood(Path(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]), int(sys.argv[5]))
    else:
        kill(Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
