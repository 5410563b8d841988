"""A virtual drive at its port: lines in real time, commands obeyed, cables pulled."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from typing import BinaryIO

from frictionid.rig.virtual_drive.controller import Controller, Drive, unplug_moments
from frictionid.rig.virtual_drive.terminal import Terminal

_BATCH = 256  # lines at a time
_WAIT = 0.02  # [s]
_UNPLUGGED = 0.3  # [s] that a pulled cable stays out
_HALF_LINE = 7  # bytes of the line during which the cable is pulled


def play(
    drive: Drive,
    terminal: Terminal,
    *,
    speed: float = 1.0,
    sent: BinaryIO | None = None,
    before_unplug: Callable[[], None] | None = None,
) -> int:
    """Play a recording to whoever opens the port; the number of undamaged lines sent.

    speed : times real time, infinite for as fast as they are read
    sent : file for the undamaged lines
    before_unplug : waits until all lines have been read; by default `Terminal.drain`
    """
    return _Playback(drive, terminal, speed, sent, before_unplug or terminal.drain).run()


@contextlib.contextmanager
def plugged(terminal: Terminal) -> Iterator[Terminal]:
    """The terminal, unplugged at the end."""
    try:
        yield terminal
    finally:
        terminal.unplug()


class _Schedule:
    """Number of lines due at a moment, at `rate` lines per second from line `first` on."""

    def __init__(self, rate: float, first: int) -> None:
        self._rate, self._first, self._start = rate, first, time.monotonic()

    def due(self) -> int:
        """Lines due by now: all, at an infinite rate."""
        if math.isinf(self._rate):
            return 1 << 62
        return self._first + int((time.monotonic() - self._start) * self._rate) + 1

    def resume(self, line: int) -> int:
        """The line to continue with after a pause: in real time the lines meanwhile are lost."""
        return line if math.isinf(self._rate) else max(line, self.due())


class _Playback:
    """A playback in progress: the next line, and the undamaged lines sent before it."""

    def __init__(
        self,
        drive: Drive,
        terminal: Terminal,
        speed: float,
        sent: BinaryIO | None,
        drain: Callable[[], None],
    ) -> None:
        self._drive, self._terminal, self._sent, self._drain = drive, terminal, sent, drain
        self._controller = Controller(drive)
        self._unplug_at = unplug_moments(drive)
        self._speed = speed
        self._next, self._good = 0, 0

    def run(self) -> int:
        """Play all lines; the number of undamaged ones."""
        self._wait_for_host()
        schedule = _Schedule(self._drive.rate * self._speed, self._next)
        while self._next < self._drive.lines:
            for line in self._terminal.received():
                self._controller.obey(self._next, line)
            unplug = self._unplug_at[0] if self._unplug_at else self._drive.lines
            stop = min(schedule.due(), self._next + _BATCH, self._drive.lines, unplug)
            if self._next >= unplug:
                self._unplug()
                self._next = schedule.resume(self._next + 1)
            elif stop <= self._next:
                time.sleep(min(_WAIT, 0.5 / self._drive.rate / self._speed))
            elif self._send_lines(stop):
                self._next = stop
            else:  # the host has closed the port
                self._next = stop
                self._wait_for_host()
                self._next = schedule.resume(stop)
        self._drain()
        return self._good

    def _wait_for_host(self) -> None:
        """Wait until the port is open and, where the protocol has a begin command, that came."""
        controller, begin = self._controller, self._drive.rig.protocol.begin
        stopped, controller.stopped = controller.stopped, True
        while controller.stopped if begin else not self._terminal.is_open():
            for line in self._terminal.received(_WAIT):
                controller.obey(self._next, line)
            if not begin:
                time.sleep(_WAIT)
        controller.stopped = stopped and controller.stopped

    def _unplug(self) -> None:
        """Pull the cable in the middle of a line, and plug it in again."""
        self._unplug_at.pop(0)
        self._send(self._controller.line(self._next)[:_HALF_LINE])
        self._drain()
        self._terminal.unplug()
        time.sleep(_UNPLUGGED / max(self._speed, 1.0))
        self._terminal.plug()
        self._wait_for_host()

    def _send_lines(self, stop: int) -> bool:
        """Send the lines before `stop`, some of them damaged; False where nobody reads them."""
        content, undamaged = b"", []
        for k in range(self._next, stop):
            line = self._controller.line(k)
            damaged = self._controller.damaged(line)
            content += line if damaged is None else damaged
            if damaged is None:
                undamaged.append(line)
        if not self._send(content):
            return False
        if self._sent is not None:
            self._sent.writelines(undamaged)
            self._sent.flush()
        self._good += len(undamaged)
        return True

    def _send(self, content: bytes) -> bool:
        """Send all bytes; False where the host has closed the port."""
        while content:
            done = self._terminal.send(content, 0.1)
            content = content[done:]
            if not done and not self._terminal.is_open():
                return False
        return True
