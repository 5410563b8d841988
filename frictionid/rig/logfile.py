"""The log of a drive as a file: rows are appended so that a crash loses none, and read again.

A CSV table with the columns

    host [s], the protocol's columns as they came (time in s), torque [N m] of each motor

`host` is the arrival of a row by this computer's clock (Unix time without later corrections),
`time` that of the controller. Whole rows are written at once, without a buffer, and synced to the
disk twice a second. The last row of a file can be incomplete, and a power cut can leave zero bytes
in place of rows that were not yet synced: such rows are left out.
"""

import contextlib
import os
import threading
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.data.readers.csv_table import csv_columns
from frictionid.data.signals import Array
from frictionid.errors import InputError
from frictionid.files import read_bytes, sync_folder

from .rig_settings import Cells, RigSettings

_CLOSE = 5.0  # [s] to which a counter that wraps around must agree with the host's clock
_OUTLIER = 60.0  # [s]: a single time so far from both its neighbours is a damaged number


# Runs of the controller's clock, from start to restart: time (K,) [s], counters unwrapped within a
# run; number (K,) of the run, from 0; and which rows (K,) have a time that is neither damaged nor
# repeated.
ClockRuns = tuple[Array, NDArray[np.int64], NDArray[np.bool_]]


def clock_runs(time: Array, host: Array, wrap: float) -> ClockRuns:
    """Runs of a controller's clock.

    Where the time goes back, the counter has wrapped around if the host's clock agrees with that;
    else the controller has restarted.

    Parameters
    ----------
    time, host : (K,) [s], as logged
    wrap : float [s], span of the controller's counter

    Examples
    --------
    >>> host = np.arange(6.0)
    >>> clock_runs(np.array([8.0, 9.0, 0.0, 1.0, 0.5, 1.5]), host, 10.0)[:2]
    (array([ 8. ,  9. , 10. , 11. ,  0.5,  1.5]), array([0, 0, 0, 0, 1, 1]))
    """
    kept = ~_outliers(time)
    index = np.flatnonzero(kept)
    clock, seen = time[index], host[index]
    wraps, restarts = np.zeros(len(clock)), np.zeros(len(clock), dtype=np.int64)
    for k in np.flatnonzero(np.diff(clock) < 0) + 1:
        ahead = clock[k] + wrap - clock[k - 1]
        wrapped = abs(ahead - (seen[k] - seen[k - 1])) < _CLOSE and ahead < wrap / 2
        (wraps if wrapped else restarts)[k] = 1
    number, turns = np.cumsum(restarts), np.cumsum(wraps)
    first = np.searchsorted(number, number)  # of the run: a restart sets the counter to zero
    clock = clock + wrap * (turns - turns[first])
    repeated = np.zeros(len(clock), dtype=bool)
    repeated[1:] = (np.diff(clock) <= 0) & (np.diff(number) == 0)
    kept[index[repeated]] = False
    whole, numbers = time.copy(), np.zeros(len(time), dtype=np.int64)
    whole[index], numbers[index] = clock, number
    return whole, numbers, kept


def unified_time(runs: ClockRuns, host: Array) -> tuple[Array, float]:
    """Time (K,) [s] of all runs on the clock of the first, and its uncertainty at the joints [s].

    Runs are joined by the host's clock, each by the line that arrived soonest after it was sent.
    """
    clock, number, kept = runs
    time, uncertainty = clock.copy(), 0.0
    first, delays = 0.0, []
    for run in range(int(number.max(initial=0)) + 1):
        rows = (number == run) & kept
        if rows.any():
            late = host[rows] - clock[rows]
            soonest = float(late.min())
            first = soonest if run == 0 else first
            time[number == run] += soonest - first
            delays.append(float(np.median(late) - soonest))
            uncertainty = max(delays) if run else 0.0
    return time, uncertainty


def _outliers(time: Array) -> NDArray[np.bool_]:
    """Single times far from both neighbours, which themselves follow each other."""
    out = np.zeros(len(time), dtype=bool)
    if len(time) < 3:
        return out
    step = np.abs(np.diff(time))
    far = (step[:-1] > _OUTLIER) & (step[1:] > _OUTLIER)
    out[1:-1] = far & (np.abs(time[2:] - time[:-2]) < _CLOSE)
    return out


_SYNC = 0.5  # [s] between two syncs to the disk
_DIGITS = {"s": 0, "ms": 3, "us": 6}


def log_header(rig: RigSettings) -> str:
    """First line of the file."""
    torques = zip(rig.torque_columns(), rig.motors, strict=True)
    names = [name for name, motor in torques if not motor.torque]
    return ",".join(("host", *rig.protocol.columns, *names))


def log_row(rig: RigSettings, host: str, cells: Cells) -> str:
    r"""Row of the file for a row of the protocol that arrived at `host`.

    >>> from frictionid.rig.rig_settings import rig_settings_of
    >>> rig = rig_settings_of({"motor": {"kt": 0.01, "gear": 10.0}}, "rig.toml")
    >>> log_row(rig, "7.000000", (b"1500000", b"0.1", b"2"))
    '7.000000,1.500000,0.1,2,0.2\n'
    """
    protocol = rig.protocol
    texts = [cell.decode("ascii").strip() for cell in cells]
    values = dict(zip(protocol.columns, texts, strict=True))
    values["time"] = seconds(values["time"], protocol.unit)
    torques = [
        f"{m.per_measured * float(values[m.measured]):.9g}" for m in rig.motors if not m.torque
    ]
    return ",".join((host, *values.values(), *torques)) + "\n"


def seconds(text: str, unit: str) -> str:
    """Text of a time in seconds, exact.

    >>> seconds("1234567", "us"), seconds("5", "ms"), seconds("1.25", "s")
    ('1.234567', '0.005', '1.25')
    """
    return f"{Decimal(text).scaleb(-_DIGITS[unit]):f}"


class Appender:
    """A file to which whole rows are appended.

    Raises
    ------
    InputError
        Where the file exists and is not to be continued, or is another log; and where rows cannot
        be written: those before are safe.
    """

    def __init__(self, path: Path, header: str, *, append: bool = False) -> None:
        self.path, self.rows = path, 0
        existed = path.exists()
        if existed and not append:
            raise InputError(
                f"{path} exists and is not overwritten: choose another name, or --append to it"
            )
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT
        try:
            self._file = os.open(path, flags if existed else flags | os.O_EXCL, 0o644)
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}); check it") from None
        if not existed:
            sync_folder(path.parent)
        self._wake, self._dirty = threading.Event(), threading.Event()
        try:
            self._begin(header)
        except BaseException:
            os.close(self._file)
            raise
        # in a thread: the disk may take long, and rows keep coming
        self._syncing = threading.Thread(target=self._sync, daemon=True)
        self._syncing.start()

    def append(self, rows: Sequence[str]) -> None:
        """Write whole rows."""
        if rows:
            self._write("".join(rows).encode())
            self.rows += len(rows)
            self._dirty.set()

    def close(self) -> None:
        """Sync all rows to the disk and close the file."""
        if self._file < 0:
            return
        self._wake.set()
        self._syncing.join()
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        os.close(self._file)
        self._file = -1

    def _begin(self, header: str) -> None:
        size = os.fstat(self._file).st_size
        if not size:
            self._write(f"{header}\n".encode())
            return
        content = read_bytes(self.path)
        if content.partition(b"\n")[0].decode("utf-8", "replace") != header:
            raise InputError(f"{self.path} has other columns than {header!r}: choose another name")
        whole = content.rfind(b"\n") + 1
        if not whole:  # the header without its line end
            self._write(b"\n")
        elif whole < size:
            os.ftruncate(self._file, whole)

    def _write(self, content: bytes) -> None:
        while content:
            try:
                content = content[os.write(self._file, content) :]
            except OSError as error:
                raise InputError(
                    f"{self.path} cannot be written ({error.strerror}): "
                    f"{self.rows} rows before are safe; make room and --append"
                ) from None

    def _sync(self) -> None:
        while not self._wake.wait(_SYNC):
            if self._dirty.is_set():
                self._dirty.clear()
                with contextlib.suppress(OSError):
                    os.fdatasync(self._file)


class Log(NamedTuple):
    """Columns of a log, arrays (K,), and its file, for errors."""

    file: str
    columns: dict[str, Array]

    def unified(self, wrap: float) -> "tuple[Log, ClockRuns, float]":
        """Usable rows on one controller time, its runs, and the uncertainty of their joints [s]."""
        runs = clock_runs(self.columns["time"], self.columns["host"], wrap)
        time, uncertainty = unified_time(runs, self.columns["host"])
        kept = runs[-1].copy()
        # runs joined by the host's clock may overlap
        latest = np.maximum.accumulate(np.where(kept, time, -np.inf))
        kept[1:] &= time[1:] > latest[:-1]
        columns = {k: (time if k == "time" else v)[kept] for k, v in self.columns.items()}
        return Log(self.file, columns), runs, uncertainty


def _whole_rows(content: bytes) -> bytes:
    r"""Lines that are whole: with their end, and without what a power cut left as zero bytes.

    >>> _whole_rows(b"time,torque\n1,2\n3,\0\0\0,6\n7,8\n9,1")
    b'time,torque\n1,2\n7,8\n'
    """
    lines = content[: content.rfind(b"\n") + 1].splitlines(keepends=True)
    return b"".join(line for line in lines if b"\0" not in line)


def column_names(content: bytes) -> list[str]:
    """Names in the first line of a table with commas."""
    return content.partition(b"\n")[0].decode("utf-8", "replace").strip().split(",")


def read_log(path: Path, columns: Sequence[str] = ()) -> Log:
    """Log of a file; an incomplete last row, and rows with zero bytes, are left out.

    columns : required beside the time; without a column `host` the time stands for it

    Raises
    ------
    InputError
        Where the file is no log, has no rows, or a row was changed by hand.
    """
    content, file = _whole_rows(read_bytes(path)), str(path)
    header = column_names(content)
    for name in ("time", *columns):
        if name not in header:
            raise InputError(
                f"{file} has no column {name!r}; it has {', '.join(header)}: name a log as "
                "frictionid log writes it"
            )
    if content.count(b"\n") < 2:
        raise InputError(f"{file} has no rows; log again")
    rows, picked, _ = csv_columns(content, file, header)
    for name, column in picked.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            raise InputError(
                f"{file}, row {rows[bad[0]]}: {name!r} is empty or no finite number; delete the row"
            )
    # another program knows no time of arrival
    return Log(file, {"host": picked["time"], **picked})
