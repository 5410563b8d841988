"""Logging a drive from its serial port to a file, through unplugging, garbage and restarts."""

from __future__ import annotations

import errno
import os
import select
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from frictionid.errors import InputError, needs
from frictionid.rig.logfile import Appender, Layout
from frictionid.rig.protocol import Cells, Format, Rejected, diagnosis, framed, parsed
from frictionid.rig.rig_settings import RigSettings

with needs("drive"):
    import serial
    from serial.tools import list_ports


_CHUNK = 65536
_WRITE_TIMEOUT = 1.0  # [s]


class UnpluggedError(Exception):
    """The port is gone."""


class Port:
    """An open serial port.

    Raises
    ------
    InputError
        Where it does not exist, is busy or may not be opened.
    UnpluggedError
        From all methods, where the port is gone.
    """

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        try:
            # exclusive: another reader would take bytes away
            self._serial: Any = serial.Serial(
                name, baud, timeout=0, write_timeout=_WRITE_TIMEOUT, exclusive=True
            )
        except (serial.SerialException, OSError, ValueError, OverflowError) as error:
            raise InputError(_complaint(name, baud, error)) from None

    def read(self, timeout: float) -> bytes:
        """Bytes that came within `timeout` [s]."""
        try:
            handle = self._serial.fileno()
            if not select.select([handle], [], [], timeout)[0]:
                return b""
            new = os.read(handle, _CHUNK)
        except (serial.SerialException, OSError, TypeError) as error:
            raise UnpluggedError(str(error)) from None
        if not new:
            raise UnpluggedError("nothing to read from a port that has something")
        return new

    def write(self, content: bytes) -> None:
        """Send bytes."""
        try:
            self._serial.write(content)
        except (serial.SerialException, OSError) as error:
            raise UnpluggedError(str(error)) from None

    def close(self) -> None:
        """Close the port."""
        try:
            self._serial.close()
        except (serial.SerialException, OSError):
            pass


def _complaint(name: str, baud: int, error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT or not Path(name).exists():
        known = sorted(p.device for p in list_ports.comports())
        there = f"; there are {', '.join(known)}" if known else "; plug the drive in"
        return f"there is no port {name}{there}"
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or "lock" in text:
        return f"port {name} is busy: another program has it open; close that first"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"port {name} is not open to you: become a member of its group "
            f"({_group(name)}), and log in again"
        )
    if isinstance(error, ValueError | OverflowError):
        return f"port {name} has no rate of {baud} baud; choose another with --baud"
    return f"port {name} cannot be opened ({os.strerror(number) if number else text}); check it"


def _group(name: str) -> str:
    try:
        return Path(name).group()
    except (OSError, KeyError):
        return "often dialout"


_RETRY = 0.1  # [s] between two attempts to open a port that is gone
# So many bytes or damaged lines without a good line are no drive of this protocol.
_MAX_BYTES, _MAX_REJECTED = 4096, 20
_KEPT = 20  # rejected lines that are kept for the diagnosis


def host_clock() -> Callable[[], float]:
    """A clock [s] that starts at Unix time and ignores later corrections of it."""
    wall, steady = time.time(), time.monotonic()
    return lambda: wall + (time.monotonic() - steady)


@dataclass
class Counts:
    """Statistics of a log.

    rows : good lines; rejected : damaged ones; size : bytes; unplugged : times that the port
    disappeared; restarts : times that the controller's clock went back; last : newest values
    """

    rows: int = 0
    rejected: int = 0
    size: int = 0
    unplugged: int = 0
    restarts: int = 0
    last: Cells = ()
    reasons: Counter[str] = field(default_factory=Counter)


class Logger:
    """Appends the good lines of a port to a file.

    port : opens the port; raises InputError where it cannot
    """

    def __init__(
        self,
        port: Callable[[], Port],
        layout: Layout,
        out: Appender,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.counts = Counts()
        self.rig = layout.rig
        self._open, self._layout, self._out = port, layout, out
        self._clock = clock or host_clock()
        self._form: Format = self.rig.protocol.format()
        self._at = self.rig.protocol.columns.index("time")
        self._remainder, self._bad = b"", deque[Rejected](maxlen=_KEPT)
        self._port: Port | None = None
        self._connect()

    @property
    def connected(self) -> bool:
        """Whether the port is there."""
        return self._port is not None

    def pump(self, timeout: float) -> list[Cells]:
        """Rows that came within `timeout` [s]; they are in the file already.

        Raises
        ------
        InputError
            Where no line can be read, and where the file cannot be written.
        """
        if self._port is None:
            self._reconnect(timeout)
        if self._port is None:
            return []
        try:
            new = self._port.read(timeout)
        except UnpluggedError:
            self._lost()
            return []
        return self._take(new)

    def send(self, text: str) -> bool:
        """Send a command with mark and checksum; False where the port is gone."""
        if self._port is None:
            return False
        try:
            self._port.write(framed(self._form, text))
        except UnpluggedError:
            self._lost()
            return False
        return True

    def close(self) -> None:
        """Close port and file; all rows are on the disk."""
        if self._port is not None:
            self._port.close()
            self._port = None
        self._out.close()

    def _take(self, new: bytes) -> list[Cells]:
        found = parsed(self._form, self._remainder, new)
        self._remainder = found.remainder
        host = f"{self._clock():.6f}"
        self._out.append([self._layout.row(host, cells) for cells in found.rows])
        self._count(found.rows, found.rejected, len(new))
        return found.rows

    def _count(self, rows: list[Cells], rejected: list[Rejected], size: int) -> None:
        counts = self.counts
        counts.size += size
        counts.rejected += len(rejected)
        counts.reasons.update(r.reason for r in rejected)
        self._bad.extend(rejected)
        before = counts.last
        for cells in rows:
            if before:
                back = float(before[self._at]) - float(cells[self._at])
                # a larger step back is a counter that wraps around
                counts.restarts += 0 < back < self._form.wrap / 2
            before = cells
        counts.last = before
        counts.rows += len(rows)
        hopeless = counts.rejected >= _MAX_REJECTED or counts.size >= _MAX_BYTES
        if hopeless and not counts.rows:
            bad = [*self._bad, *([Rejected(self._remainder, "garbage")] if not self._bad else [])]
            raise InputError(f"{self._name()}: {diagnosis(self._form, bad, counts.size)}")

    def _name(self) -> str:
        return f"port {self._port.name}" if self._port else "port"

    def _connect(self) -> None:
        self._port = self._open()
        self._remainder = b""
        if self.rig.protocol.begin:
            self.send(self.rig.protocol.begin)

    def _lost(self) -> None:
        """The port is gone, and with it the line that had begun."""
        if self._port is not None:
            self._port.close()
        self._port = None
        self.counts.unplugged += 1

    def _reconnect(self, timeout: float) -> None:
        try:
            self._connect()
        except InputError:
            time.sleep(min(timeout, _RETRY))


@contextmanager
def open_logger(
    name: str, baud: int | None, rig: RigSettings, out: Path, *, append: bool = False
) -> Iterator[Logger]:
    """Logger of the port `name` to a file; both are closed at the end, and an empty log removed.

    baud : in place of that of the rig; append : whether to continue an existing file

    Raises
    ------
    InputError
        Where port or file cannot be opened.
    """

    def port() -> Port:
        return Port(name, baud or rig.protocol.baud)

    layout = Layout(rig)
    opened = [port()]  # first: without a port no file is made
    try:
        file = Appender(out, layout.header, more=append)
    except BaseException:
        opened.pop().close()
        raise
    logger = Logger(lambda: opened.pop() if opened else port(), layout, file)
    try:
        yield logger
    finally:
        logger.close()
        if not file.rows and not append:
            out.unlink(missing_ok=True)
