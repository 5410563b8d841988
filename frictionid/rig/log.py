"""Logging a drive from its serial port to a file, through unplugging, garbage and restarts."""

import contextlib
import errno
import os
import select
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from frictionid.errors import InputError, needs

from .logfile import Appender, log_header, log_row
from .rig_settings import Cells, Rejected, RigSettings, diagnosis, framed, parsed

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
        with contextlib.suppress(serial.SerialException, OSError):
            self._serial.close()


def _complaint(name: str, baud: int, error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT or not Path(name).exists():
        ports = sorted(p.device for p in list_ports.comports())
        there = f"; there are {', '.join(ports)}" if ports else "; plug the drive in"
        return f"there is no port {name}{there}"
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or "lock" in text:
        return f"port {name} is busy: another program has it open; close that first"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"port {name} is not open to you: become a member of its group "
            f"({_group(name)}), and log in again"
        )
    if isinstance(error, ValueError | OverflowError):
        return f"port {name} has no rate of {baud} baud; choose another baud"
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


class Logger:
    """Appends the good lines of the port `name` to a file.

    append : whether to continue an existing file
    show : is called with the counts, and whether the port is there, whenever lines may have come
    """

    def __init__(
        self,
        name: str,
        rig: RigSettings,
        out: Path,
        *,
        append: bool = False,
        show: Callable[[Counts, bool], None] = lambda *_: None,
    ) -> None:
        self.counts = Counts()
        self.rig, self.show = rig, show
        self._name, self._append = name, append
        self._zero = time.time() - time.monotonic()  # later corrections of the clock are ignored
        self._at = rig.protocol.columns.index("time")
        self._remainder, self._bad = b"", deque[Rejected](maxlen=_KEPT)
        self._port: Port | None = Port(name, rig.protocol.baud)  # first: without it no file is made
        try:
            self._out = Appender(out, log_header(rig), append=append)
        except BaseException:
            self._port.close()
            raise
        self._begin()

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
        rows: list[Cells] = []
        if self._port is None:
            try:
                self._port = Port(self._name, self.rig.protocol.baud)
            except InputError:
                time.sleep(min(timeout, _RETRY))
            else:
                self._begin()
        if self._port is not None:
            try:
                rows = self._take(self._port.read(timeout))
            except UnpluggedError:
                self._lost()
        self.show(self.counts, self.connected)
        return rows

    def send(self, text: str) -> bool:
        """Send a command with mark and checksum; False where the port is gone."""
        if self._port is None:
            return False
        try:
            self._port.write(framed(self.rig.protocol, text))
        except UnpluggedError:
            self._lost()
            return False
        return True

    def close(self) -> None:
        """Close port and file; all rows are on the disk, and an empty log is removed."""
        if self._port is not None:
            self._port.close()
            self._port = None
        self._out.close()
        if not self._out.rows and not self._append:
            self._out.path.unlink(missing_ok=True)

    def _take(self, new: bytes) -> list[Cells]:
        rows, rejected, self._remainder = parsed(self.rig.protocol, self._remainder, new)
        host = f"{self._zero + time.monotonic():.6f}"
        self._out.append([log_row(self.rig, host, cells) for cells in rows])
        counts = self.counts
        counts.size += len(new)
        counts.rejected += len(rejected)
        self._bad.extend(rejected)
        before = counts.last
        for cells in rows:
            if before:
                back = float(before[self._at]) - float(cells[self._at])
                # a larger step back is a counter that wraps around
                counts.restarts += 0 < back < self.rig.protocol.wrap / 2
            before = cells
        counts.last = before
        counts.rows += len(rows)
        hopeless = counts.rejected >= _MAX_REJECTED or counts.size >= _MAX_BYTES
        if hopeless and not counts.rows:
            bad = self._bad or [(self._remainder, "garbage")]
            raise InputError(f"port {self._name}: {diagnosis(self.rig.protocol, bad, counts.size)}")
        return rows

    def _begin(self) -> None:
        self._remainder = b""
        if self.rig.protocol.begin:
            self.send(self.rig.protocol.begin)

    def _lost(self) -> None:
        """The port is gone, and with it the line that had begun."""
        if self._port is not None:
            self._port.close()
        self._port = None
        self.counts.unplugged += 1


_PUMP = 0.1  # [s]
_SHOW = 0.5  # [s] between two lines that are shown


@contextlib.contextmanager
def progress_line(columns: Sequence[str]) -> Iterator[Callable[[Counts, bool], None]]:
    """Shows counts in one line that is rewritten on a terminal; elsewhere only connections."""
    stream, at, rows, there = sys.stderr, time.monotonic(), 0, True
    clear = "\r\033[K" if stream.isatty() else ""

    def say(text: str) -> None:
        stream.write(clear + text)
        stream.flush()

    def show(counts: Counts, connected: bool) -> None:
        nonlocal at, rows, there
        if connected != there:
            say("the port is back\n" if connected else "the port is gone: waiting for it\n")
            there = connected
        now = time.monotonic()
        if now - at < _SHOW:
            return
        rate = (counts.rows - rows) / (now - at)
        at, rows = now, counts.rows
        if clear:
            say(progress(columns, counts, rate))

    try:
        yield show
    finally:
        say("")


def progress(columns: Sequence[str], counts: Counts, rate: float) -> str:
    """Rate, errors and newest values in one line."""
    values = ", ".join(
        f"{name} {cell.decode().strip()}" for name, cell in zip(columns, counts.last, strict=False)
    )
    return f"{rate:.0f} lines/s, {counts_text(counts)}{'; ' if values else ''}{values}"


def counts_text(counts: Counts) -> str:
    """Numbers of lines and of faults.

    >>> counts_text(Counts(rows=7, unplugged=1))
    '7 lines, 0 damaged, 1 unplugged, 0 restarts'
    """
    return (
        f"{counts.rows} lines, {counts.rejected} damaged, {counts.unplugged} unplugged, "
        f"{counts.restarts} restarts"
    )


@contextlib.contextmanager
def open_logger(port: str, rig: RigSettings, out: Path, *, append: bool) -> Iterator[Logger]:
    """A logger that shows its progress and, at its end, what it has counted and written."""
    with (
        progress_line(rig.protocol.columns) as show,
        contextlib.closing(Logger(port, rig, out, append=append, show=show)) as logger,
    ):
        yield logger
    print(counts_text(logger.counts))
    print(f"written to {out}")


@contextlib.contextmanager
def stop_requests() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C or SIGTERM has come; neither interrupts the program meanwhile."""
    asked: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: asked.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def log_until(
    logger: Logger,
    stop: Callable[[], bool],
    seconds: float | None = None,
    patience: float | None = None,
) -> None:
    """Log until `stop`, for `seconds` [s], or until nothing has come for `patience` [s].

    Raises
    ------
    InputError
        Where no line came.
    """
    start = last = time.monotonic()
    while not stop():
        came = bool(logger.pump(_PUMP))
        now = time.monotonic()
        last = now if came else last
        if seconds is not None and now - start > seconds:
            break
        if patience is not None and now - last > patience:
            break
    if not logger.counts.rows:
        raise InputError(
            f"no line came in {time.monotonic() - start:.0f} s ({logger.counts.size} bytes): check "
            "that the drive sends, and [protocol] with its baud"
        )
