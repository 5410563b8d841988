"""Watching a stream: external torque sample by sample, and a live estimate of friction.

A stream is a table that is still being written: a file that grows, or a serial port.
The observer as C99 stands beside its friction; the controller gives M and dL/dq.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, joined, picked
from frictionid.config import read_toml
from frictionid.data.plants import refuse_torques
from frictionid.data.readers.dataset_toml import check_dataset_toml
from frictionid.data.readers.table import rate_of, read_table
from frictionid.data.readers.table_recording import signals_of
from frictionid.data.recordings import Dataset
from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.formats import c
from frictionid.errors import InputError
from frictionid.files import dataset_path, write_bytes
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism
from frictionid.outputs import check_outputs

from .external_torque import Band, band_of, interval_torques, momentum_observer_of, with_band
from .live_friction import Chunk, Estimate, Live, LiveFriction, drawn_by_noise, worn
from .momentum_observer import MomentumObserver, State
from .monitor.baseline import reference_of
from .monitor.changes import prepared_data, recording_changes

_TURN = 2 * np.pi
_STRETCH, _LAST = 5.0, 1.0  # [s] that the live estimate takes at a time, and at least at the end


class Seen(NamedTuple):
    """What new samples said: time (K,), torque and band (K, n) [N m], and the live estimate.

    worn (2, K, n) [N m] : torque that a change of friction explains, and half its band
    estimate : None until a stretch of some seconds is complete
    damaged : sentences on rows that were left out
    """

    time: Array
    torque: Array
    band: Array
    worn: Array
    estimate: Estimate | None
    damaged: tuple[str, ...] = ()


class Watch(NamedTuple):
    """What watches a stream.

    Attributes
    ----------
    momentum_observer : MomentumObserver
    band : Band
    friction : LiveFriction
    """

    momentum_observer: MomentumObserver
    band: Band
    friction: LiveFriction

    @property
    def mechanism(self) -> Mechanism:
        """The machine."""
        return self.friction.dataset.mechanism


# where a stream is: the observer, the stretch up to the last sample, the estimate, and the change
# (2, n) of friction over its level with its variance
_Stream = tuple[State, Chunk, Live, Array]


def watch_of(friction: Friction, dataset: Dataset, response: float, rate: float) -> Watch:
    """Watch of a machine by a friction, and recordings without contact."""
    refuse_torques(dataset)
    band = band_of([(friction, dataset)], response, rate)
    momentum_observer = momentum_observer_of(friction, dataset, 0, response)
    prepared = prepared_data(dataset)
    reference = reference_of(prepared, friction)
    quiet, _ = recording_changes(prepared, reference, ())
    drawn, uncertain = drawn_by_noise(quiet, reference.effects)
    live = LiveFriction(dataset, reference, quiet.disturbed, drawn, uncertain)
    return Watch(momentum_observer, band, live)


def watched(
    watch: Watch,
    place: str | Path,
    read: Callable[[], bytes],
    idle: float = np.inf,
    header: str = "",
) -> Iterator[Seen]:
    """What the samples of a stream say, as they come; memory does not grow with its length.

    Parameters
    ----------
    watch : Watch
    place : folder of the dataset.toml that describes the columns
    read : gives the bytes that came since it was asked last
    idle : ends after so long without a byte [s]
    header : first line of the table, where the stream has none
    """
    chunk = chunks_of(place, header) if header else None
    stream: _Stream | None = None
    rows = 0
    for lines in lines_of(read, idle):
        if chunk is None and lines:
            chunk, lines, rows = chunks_of(place, lines[0]), lines[1:], 1
        if chunk is None or not lines:
            continue
        new, damaged = sound_chunk(chunk, lines, rows + 1)
        rows += len(lines)
        if new is None:
            if stream is None:
                raise InputError(damaged[0])
            yield Seen(*_nothing(watch), None, damaged)
            continue
        if stream is None:
            state = watch.momentum_observer.start(float(new.time[0]), new.angle[0], new.torque[0])
            unknown = np.stack([np.zeros_like(new.angle[0]), np.ones_like(new.angle[0])])
            stream = state, picked(new, slice(1)), watch.friction.start(), unknown
            new = picked(new, slice(1, None))
        if len(new.time):
            stream, seen = _stepped(watch, stream, new)
            yield seen._replace(damaged=damaged)
    if stream is not None and np.ptp(stream[1].time) >= _LAST:
        _, stretch, live, _ = stream
        estimate = watch.friction.estimate(watch.friction.added(live, stretch))
        yield Seen(*_nothing(watch), estimate)


def _nothing(watch: Watch) -> tuple[Array, Array, Array, Array]:
    """Time, torque, band and wear of no sample."""
    none = np.empty((0, watch.mechanism.n))
    return np.empty(0), none, none, np.stack([none, none])


def _stepped(watch: Watch, stream: _Stream, new: Chunk) -> tuple[_Stream, Seen]:
    """The stream after new samples, and what these say."""
    (before, stretch, live, change), estimate = stream, None
    both = joined([stretch, new])
    turns = np.diff(both.angle, axis=0) / _TURN
    turns *= np.array(watch.mechanism.position_units) == "rad"
    wraps = np.round(turns) * (np.abs(turns) < 1.5)  # more: an encoder that is set anew
    both.angle[1:] -= _TURN * np.cumsum(wraps, axis=0)
    new = picked(both, slice(len(stretch.time), None))
    torque = interval_torques(watch.friction.torque_of(both), both.time)[-len(new.time) :]
    state, said = watch.momentum_observer.advance(before, new.time, new.angle, torque)
    anew = np.flatnonzero(np.diff(said.begin, prepend=before.begin))
    for k, rows in enumerate(np.split(np.arange(len(new.time)), anew)):
        after = picked(new, rows)
        if k and np.ptp(stretch.time) >= _LAST:
            live = watch.friction.added(live, stretch)
        stretch = after if k else joined([stretch, after])
        while np.ptp(stretch.time) >= _STRETCH:  # the same however many samples come at a time
            end = int(np.argmax(stretch.time - stretch.time[0] >= _STRETCH))
            live = watch.friction.added(live, picked(stretch, slice(end + 1)))
            estimate, stretch = watch.friction.estimate(live), picked(stretch, slice(end, None))
    *wear, change = worn(said, watch.band, before.time, change)
    seen = Seen(said.time, *with_band(said, watch.band), np.stack(wear), estimate)
    return (state, stretch, live, change), seen


# --- As C -----------------------------------------------------------------------------------------


def write_code(watch: Watch, out: Path, read: Sequence[Path], *, replace: bool) -> tuple[Path, ...]:
    """Write a C source and its header; their paths.

    Raises
    ------
    InputError
        For laws with memory or loads, and parts that turn with several joints.
    """
    source, mechanism = watch.momentum_observer, watch.mechanism
    friction = source.friction
    if friction.law.has_memory or friction.law.uses_load or mechanism.coupled:
        raise InputError(
            "watch: code is for static laws of each joint without loads: fit another law, or run "
            "frictionid watch"
        )
    paths = out.with_suffix(".c"), out.with_suffix(".h")
    check_outputs(paths, read, replace=replace)
    model = exported(friction, mechanism.joints)
    settings = ExportSettings(stem=out.stem)
    written = c.write(model, settings).files
    arguments = [*ex.functions(model)[0].arguments, "Tf"]
    names = {"observer": source, "members": source.members, "band": watch.band, "array": _array}
    context = {**names, "motors": mechanism.motors, "arguments": arguments}
    head, body = (
        ex.rendered(f"observer.{ending}.j2", model, settings, context).decode()
        for ending in ("h", "c")
    )
    end = "#ifdef __cplusplus\n}"
    header = written[".h"].decode().replace(end, f"{head}\n{end}")
    write_bytes(paths[0], written[".c"] + body.encode())
    write_bytes(paths[1], header.encode())
    return paths


def _array(values: Array) -> str:
    return "{" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "}"


# --- Rows of a table that is still being written --------------------------------------------------

_PAUSE = 0.02  # [s] between two looks
_MOST = 1 << 20  # bytes at a time
_NAME = "stream.csv"


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
