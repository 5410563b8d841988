"""Rows of a table that is still being written: of a file that grows, or of a serial port."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import read_toml
from frictionid.data.readers.dataset_toml import check_dataset_toml
from frictionid.data.readers.table import rate_of, read_table
from frictionid.data.readers.table_recording import signals_of
from frictionid.errors import InputError
from frictionid.files import dataset_path

_PAUSE = 0.02  # [s] between two looks
_MOST = 1 << 20  # bytes at a time
_NAME = "stream.csv"


class Chunk(NamedTuple):
    """Samples on one clock: time (K,) [s], angle and torque (K, n)."""

    time: Array
    angle: Array
    torque: Array


def chunks_of(dataset: str | Path, header: str) -> Callable[[list[str]], Chunk]:
    """A function that reads complete lines below a header, as a folder's dataset.toml has columns.

    It refuses a damaged line, and torques on a clock of their own.
    """
    file = dataset_path(Path(dataset))
    toml = check_dataset_toml(read_toml(file), str(file))
    if toml.columns is None:
        raise InputError(f"{file}: a stream needs [columns]; this data set has a reader of its own")
    if rate_of(toml.columns.time.angle):
        raise InputError(f"{file}: a stream needs a column of times: lines may be lost")

    def chunk(lines: list[str]) -> Chunk:
        table = read_table("\n".join([header, *lines]).encode(), _NAME, toml.asked.names())
        signals = signals_of(table, toml)
        angle, torque = signals["angle"], signals["torque"]
        if not np.array_equal(angle.time, torque.time):
            raise InputError("a stream needs angles and torques on one clock: log them together")
        return Chunk(angle.time, *(np.asarray(s.value, dtype=float) for s in (angle, torque)))

    return chunk


def sound_chunk(
    chunk: Callable[[list[str]], Chunk], lines: list[str], row: int
) -> tuple[Chunk | None, tuple[str, ...]]:
    """Samples of the lines that are not damaged, and sentences on the others.

    row : of the first line in the stream
    """
    try:
        return chunk(lines), ()
    except InputError:
        sound, damaged = list[str](), list[str]()
    for k, line in enumerate(lines):
        try:
            chunk([line])
            sound.append(line)
        except InputError as error:
            damaged.append(f"row {row + k}, {line!r}, is left out: {error}")
    return (chunk(sound) if sound else None), tuple(damaged)


def part(chunk: Chunk, first: int, end: int | None = None) -> Chunk:
    """Some of its samples."""
    return Chunk(*(values[first:end] for values in chunk))


def bytes_of_file(path: Path) -> Callable[[], bytes]:
    """A function that gives what was written to a file since it was asked last."""
    place = 0

    def read() -> bytes:
        nonlocal place
        with path.open("rb") as handle:
            handle.seek(place)
            new = handle.read(_MOST)
        place += len(new)
        return new

    return read


def lines_of(read: Callable[[], bytes], idle: float) -> Iterator[list[str]]:
    r"""Complete lines that came, until nothing has come for `idle` seconds; [] while none comes.

    >>> parts = iter([b"a,b\n1,", b"2\n3,4", b"\n"])
    >>> list(filter(None, lines_of(lambda: next(parts, b""), 0.0)))
    [['a,b'], ['1,2'], ['3,4']]
    """
    rest, last = b"", time.monotonic()
    while True:
        new = read()
        if new:
            *whole, rest = (rest + new).split(b"\n")
            last = time.monotonic()
            yield [line.decode("utf-8", "replace").strip() for line in whole if line.strip()]
        elif time.monotonic() - last >= idle:
            return
        else:
            yield []
            time.sleep(_PAUSE)
