"""Logging a drive: from its port to a file, through unplugging, garbage and restarts."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from frictionid.acquire.logfile import Appender, Layout
from frictionid.acquire.port import Port, UnpluggedError
from frictionid.acquire.protocol import Cells, Format, Rejected, diagnosis, framed, parsed
from frictionid.errors import InputError

_TRIES = 0.1  # [s] between two tries to open a port that is gone
# So many bytes without a single line are no drive of this protocol.
_HOPELESS_BYTES, _HOPELESS_LINES = 4096, 20
_SHOWN = 20  # rejected lines that are kept to tell what is wrong


def host_clock() -> Callable[[], float]:
    """A clock [s] that begins with Unix time and that no later correction moves."""
    wall, steady = time.time(), time.monotonic()
    return lambda: wall + (time.monotonic() - steady)


@dataclass
class Counts:
    """What has come so far.

    rows : good lines; rejected : damaged ones; size : bytes; unplugged : times that the port went
    away; restarts : times that the controller's clock went back; last : newest values
    """

    rows: int = 0
    rejected: int = 0
    size: int = 0
    unplugged: int = 0
    restarts: int = 0
    last: Cells = ()
    reasons: Counter[str] = field(default_factory=Counter)


class Logger:
    """A port whose good lines are appended to a file.

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
        self._open, self._layout, self._out = port, layout, out
        self._clock = clock or host_clock()
        self._form: Format = layout.setup.protocol.format()
        self._at = layout.setup.protocol.columns.index("time")
        self._rest, self._bad = b"", deque[Rejected](maxlen=_SHOWN)
        self._port: Port | None = None
        self._connect()

    @property
    def connected(self) -> bool:
        """Whether the port is there."""
        return self._port is not None

    def pump(self, timeout: float) -> list[Cells]:
        """Rows that came within `timeout` [s], which are in the file by now.

        Raises
        ------
        InputError
            Where nothing of what comes can be read, and where the file cannot be written.
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
        """Send a framed command; False where the port is gone."""
        if self._port is None:
            return False
        try:
            self._port.write(framed(self._form, text))
        except UnpluggedError:
            self._lost()
            return False
        return True

    def close(self) -> None:
        """Give port and file back, all rows on the disk."""
        if self._port is not None:
            self._port.close()
            self._port = None
        self._out.close()

    def _take(self, new: bytes) -> list[Cells]:
        found = parsed(self._form, self._rest, new)
        self._rest = found.rest
        host = f"{self._clock():.6f}"
        self._out.append([self._layout.row(host, cells) for cells in found.rows])
        self._count(found.rows, found.rejected, len(new))
        return found.rows

    def _count(self, rows: list[Cells], rejected: list[Rejected], size: int) -> None:
        counts = self.counts
        counts.size += size
        counts.rejected += len(rejected)
        counts.reasons.update(r.why for r in rejected)
        self._bad.extend(rejected)
        before = counts.last
        for cells in rows:
            if before:
                back = float(before[self._at]) - float(cells[self._at])
                # a counter that begins anew is none
                counts.restarts += 0 < back < self._form.wrap / 2
            before = cells
        counts.last = before
        counts.rows += len(rows)
        hopeless = counts.rejected >= _HOPELESS_LINES or counts.size >= _HOPELESS_BYTES
        if hopeless and not counts.rows:
            bad = [*self._bad, *([Rejected(self._rest, "garbage")] if not self._bad else [])]
            raise InputError(f"{self._name()}: {diagnosis(self._form, bad, counts.size)}")

    def _name(self) -> str:
        return f"port {self._port.name}" if self._port else "port"

    def _connect(self) -> None:
        self._port = self._open()
        self._rest = b""
        if self._layout.setup.protocol.begin:
            self.send(self._layout.setup.protocol.begin)

    def _lost(self) -> None:
        """What began to come is lost with the port; the rest comes from a new beginning."""
        if self._port is not None:
            self._port.close()
        self._port = None
        self.counts.unplugged += 1

    def _reconnect(self, timeout: float) -> None:
        try:
            self._connect()
        except InputError:
            time.sleep(min(timeout, _TRIES))
