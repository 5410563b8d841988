"""The simulated drive at its port: lines in their time, commands obeyed, cables pulled."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import BinaryIO

from frictionid.acquire.virtual_drive.controller import Drive, Speaker, unplug_moments
from frictionid.acquire.virtual_drive.terminal import Terminal

_MOST = 256  # lines at a time
_WAIT = 0.02  # [s]
_AWAY = 0.3  # [s] that a pulled cable stays out


def play(
    drive: Drive,
    terminal: Terminal,
    *,
    speed: float = 1.0,
    sent: BinaryIO | None = None,
    before_unplug: Callable[[], None] | None = None,
) -> int:
    """Number of undamaged lines that were sent until the recording was over.

    speed : times real time, infinite for as fast as somebody reads
    sent : file that receives the undamaged lines
    before_unplug : waits until all that was sent has been read; by default the terminal does
    """
    speaker, moments = Speaker(drive), unplug_moments(drive)
    drain = before_unplug or terminal.drain
    k, good = _begun(speaker, terminal, 0), 0
    pace = _Pace(drive.rate, speed, k)
    while k < drive.lines:
        for line in terminal.heard():
            speaker.obey(k, line)
        if moments and k >= moments[0]:
            moments.pop(0)
            _whole(terminal, speaker.line(k)[:7])
            drain()
            terminal.unplug()
            time.sleep(_AWAY / max(speed, 1.0))
            terminal.plug()
            _begun(speaker, terminal, k)
            k = pace.skipped(k + 1)
            continue
        due = min(pace.due(), k + _MOST, drive.lines, *(moments[:1] or [drive.lines]))
        if due <= k:
            time.sleep(min(_WAIT, 0.5 / drive.rate / speed))
            continue
        batch, fine = b"", []
        for line in (speaker.line(j) for j in range(k, due)):
            broken = speaker.damaged(line)
            batch += line if broken is None else broken
            if broken is None:
                fine.append(line)
        if not _whole(terminal, batch):
            k = pace.skipped(_begun(speaker, terminal, due))
            continue
        if sent is not None:
            sent.writelines(fine)
            sent.flush()
        k, good = due, good + len(fine)
    drain()
    return good


@contextlib.contextmanager
def plugged(terminal: Terminal) -> Iterator[Terminal]:
    """The terminal, unplugged at the end."""
    try:
        yield terminal
    finally:
        terminal.unplug()


class _Pace:
    """Which line is due."""

    def __init__(self, rate: float, speed: float, first: int) -> None:
        self._rate, self._speed = rate, speed
        self._start, self._first = time.monotonic(), first

    def due(self) -> int:
        """Number of lines that are due by now."""
        if self._speed == float("inf"):
            return 1 << 62
        return self._first + int((time.monotonic() - self._start) * self._rate * self._speed) + 1

    def skipped(self, k: int) -> int:
        """The line to go on with after nobody was there: in real time some are lost."""
        return k if self._speed == float("inf") else max(k, self.due())


def _begun(speaker: Speaker, terminal: Terminal, k: int) -> int:
    """The line k, when somebody has the port open and, where the protocol says so, has asked."""
    protocol = speaker.drive.setup.protocol
    stopped = speaker.stopped
    speaker.stopped = True
    while speaker.stopped if protocol.begin else not terminal.attended():
        for line in terminal.heard(_WAIT):
            speaker.obey(k, line)
        if not protocol.begin:
            time.sleep(_WAIT)
    speaker.stopped = stopped and speaker.stopped
    return k


def _whole(terminal: Terminal, content: bytes) -> bool:
    """Send all bytes; False where nobody is there any more."""
    while content:
        done = terminal.send(content, 0.1)
        content = content[done:]
        if not done and not terminal.attended():
            return False
    return True
