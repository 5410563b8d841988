"""A pseudo-terminal in place of a serial port, under a name that stays when it is replugged."""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import struct
import termios
import time
import tty
from pathlib import Path

from frictionid.errors import InputError

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
