"""A virtual drive at its port: lines in real time, commands obeyed, cables pulled."""

import contextlib
import fcntl
import math
import os
import select
import struct
import termios
import time
import tty
from pathlib import Path
from typing import BinaryIO

from frictionid.errors import InputError

from .virtual_drive import Controller, Drive, unplug_moments

_QUIET, _POLL = 3, 0.02  # polls in a row without unread bytes, [s] between them
_MAX_DRAIN = 10.0  # [s] that a reader may take
_STEP = 0.01  # [s]


class Terminal:
    """The drive's end of a serial cable; a symbolic link names the other end."""

    def __init__(self, link: Path) -> None:
        if link.is_symlink():
            link.unlink()
        if link.exists():
            raise InputError(f"{link} exists and is no link to a port: choose another --port")
        self.link = link
        self._master, self._received = -1, b""
        self.plug()

    def plug(self) -> None:
        """Make the port appear."""
        self._master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        name = os.ttyname(slave)
        new = self.link.with_name(f".{self.link.name}.{os.getpid()}")
        try:
            new.symlink_to(name)
            os.replace(new, self.link)
        except OSError as error:
            raise InputError(f"{self.link} cannot be made ({error.strerror})") from None
        finally:
            # from now on the system knows whether anybody has the port open
            os.close(slave)

    def unplug(self) -> None:
        """Make the port disappear, with all unread bytes."""
        if self._master >= 0:
            with contextlib.suppress(OSError):
                self.link.unlink()
            os.close(self._master)
            self._master, self._received = -1, b""

    def is_open(self) -> bool:
        """Whether a host has the port open."""
        poll = select.poll()
        poll.register(self._master, 0)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def send(self, content: bytes, timeout: float) -> int:
        """Bytes that the port took within `timeout` [s]."""
        if not select.select([], [self._master], [], timeout)[1]:
            return 0
        try:
            return os.write(self._master, content)
        except OSError:  # full, or nobody there any more
            return 0

    def received(self, timeout: float = 0.0) -> list[bytes]:
        """Lines that the other side sent within `timeout` [s]."""
        if not self.is_open():
            time.sleep(min(timeout, _STEP))
            return []
        if not select.select([self._master], [], [], timeout)[0]:
            return []
        with contextlib.suppress(OSError):
            self._received += os.read(self._master, 65536)
        *lines, self._received = self._received.split(b"\n")
        return lines

    def drain(self) -> None:
        """Wait until all bytes have been read, or nobody reads."""
        if not self.is_open():
            return
        slave = os.open(os.path.realpath(self.link), os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            quiet, end = 0, time.monotonic() + _MAX_DRAIN
            while quiet < _QUIET and time.monotonic() < end:
                waiting = fcntl.ioctl(slave, termios.FIONREAD, b"\0\0\0\0")
                quiet = quiet + 1 if struct.unpack("i", waiting)[0] == 0 else 0
                time.sleep(_POLL)
        finally:
            os.close(slave)


_BATCH = 256  # lines at a time
_WAIT = 0.02  # [s]
_UNPLUGGED = 0.3  # [s] that a pulled cable stays out
_HALF_LINE = 7  # bytes of the line during which the cable is pulled


class Playback:
    """Plays a recording to whoever opens the port.

    speed : times real time, infinite for as fast as they are read
    sent : file for the undamaged lines
    """

    def __init__(
        self,
        drive: Drive,
        terminal: Terminal,
        *,
        speed: float = 1.0,
        sent: BinaryIO | None = None,
    ) -> None:
        self._drive, self._terminal, self._sent = drive, terminal, sent
        self._controller = Controller(drive)
        self._unplug_at = unplug_moments(drive)
        self._rate, self._speed = drive.rate * speed, speed
        self._start, self._next, self._good = 0.0, 0, 0

    def run(self) -> int:
        """Play all lines; the number of undamaged ones."""
        self._wait_for_host()
        self._start = time.monotonic()
        while self._next < self._drive.lines:
            for line in self._terminal.received():
                self._controller.obey(self._next, line)
            unplug = self._unplug_at[0] if self._unplug_at else self._drive.lines
            stop = min(self._due(), self._next + _BATCH, self._drive.lines, unplug)
            if self._next >= unplug:
                self._unplug()
                self._next = self._resumed(self._next + 1)
            elif stop <= self._next:
                time.sleep(min(_WAIT, 0.5 / self._drive.rate / self._speed))
            elif self._send_lines(stop):
                self._next = stop
            else:  # the host has closed the port
                self._next = stop
                self._wait_for_host()
                self._next = self._resumed(stop)
        self._terminal.drain()
        return self._good

    def _due(self) -> int:
        """Number of lines due by now: all, at an infinite rate."""
        if math.isinf(self._rate):
            return self._drive.lines
        return int((time.monotonic() - self._start) * self._rate) + 1

    def _resumed(self, line: int) -> int:
        """The line to continue with after a pause: in real time the lines meanwhile are lost."""
        return line if math.isinf(self._rate) else max(line, self._due())

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
        self._terminal.drain()
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
