"""Progress of logging on the terminal, and when it ends."""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Callable, Iterator
from typing import TextIO

from frictionid.errors import InputError
from frictionid.rig.log import Counts, Logger

_PUMP = 0.1  # [s]
_SHOW = 0.5  # [s] between two lines that are shown


class ProgressLine:
    """One line that is rewritten on a terminal; elsewhere only connections are reported."""

    def __init__(self, columns: tuple[str, ...], stream: TextIO | None = None) -> None:
        self._columns, self._stream = columns, stream or sys.stderr
        self._live = self._stream.isatty()
        self._at, self._rows, self._rate = time.monotonic(), 0, 0.0
        self._connected = True

    def __call__(self, counts: Counts, connected: bool) -> None:
        """Show the counts."""
        if connected != self._connected:
            self._say("the port is back" if connected else "the port is gone: waiting for it")
            self._connected = connected
        now = time.monotonic()
        if now - self._at < _SHOW:
            return
        self._rate = (counts.rows - self._rows) / (now - self._at)
        self._at, self._rows = now, counts.rows
        if self._live:
            self._stream.write(f"\r\033[K{progress(self._columns, counts, self._rate)}")
            self._stream.flush()

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._stream.write("\r\033[K")
            self._stream.flush()

    def _say(self, text: str) -> None:
        self._stream.write(f"\r\033[K{text}\n" if self._live else f"{text}\n")
        self._stream.flush()


def progress(columns: tuple[str, ...], counts: Counts, rate: float) -> str:
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
    show: Callable[[Counts, bool], None],
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
        show(logger.counts, logger.connected)
        now = time.monotonic()
        last = now if came else last
        if seconds is not None and now - start > seconds:
            break
        if patience is not None and now - last > patience:
            break
    if not logger.counts.rows:
        raise InputError(
            f"no line came in {time.monotonic() - start:.0f} s ({logger.counts.size} bytes): check "
            "that the drive sends, --baud, and [protocol]"
        )
