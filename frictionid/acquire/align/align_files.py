"""From two files to a recording: what `frictionid align` does, without printing."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.acquire.align.clock import Alignment, Clock, align, by_marker
from frictionid.acquire.align.cross_correlation import around
from frictionid.acquire.align.drive_response import Response, response
from frictionid.acquire.align.recording_folder import (
    Angles,
    add_recording,
    check_place,
    head_of,
    read_angles,
)
from frictionid.acquire.align.sync_edges import Marked, edges_of, marked
from frictionid.acquire.controller_clock import Runs
from frictionid.acquire.logfile import Log, read_log
from frictionid.acquire.protocol import SECOND
from frictionid.acquire.rig_settings import RigSettings, rig_settings_of, rig_tables
from frictionid.data.readers.table import content_of
from frictionid.data.signals import Signal, cut
from frictionid.errors import InputError
from frictionid.mechanics import Mechanism, mechanism_of

_EPOCH = 1e8  # [s]: times beyond are Unix times, which other computers share
_LOOSE = 600.0  # [s] by which clocks of two computers may differ
_RUNS = 0.002  # [s]: joints of runs less sure than this are told


@dataclass(frozen=True, eq=False)
class Aligned:
    """A recording of two files.

    torque : n columns, by the angles' clock; command : as it was logged, by the same clock, one
    column per motor, or None; remarks : what a person should know
    """

    mechanism: Mechanism
    angle: Signal
    torque: Signal
    command: Signal | None
    found: Alignment
    marker: Marked | None
    drives: list[Response | None]
    sources: dict[str, str]
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Wanted:
    """What is asked of an alignment.

    marker : column of both files with a lamp's state or brightness
    offset : [s], to within 0.5 s, where it is known
    hold : what the logged torque does between two rows, "linear" or "previous"
    """

    marker: str = ""
    offset: float | None = None
    hold: str = "linear"


def aligned(angles: Path, log: Path, rig: Path, wanted: Wanted) -> Aligned:
    """Angles and log on one clock.

    Raises
    ------
    InputError
        For files that do not hold what they should, and clocks that nothing brings together.
    """
    document = rig_tables(rig)
    setup = rig_settings_of(document, str(rig))
    mechanism = _mechanism(setup, document)
    seen = read_angles(angles, document.get("angles", {}), mechanism, wanted.marker)
    measured = [
        m.torque or name for m, name in zip(setup.motors, setup.torque_columns(), strict=True)
    ]
    raw = read_log(log, [*measured, *([wanted.marker] if wanted.marker else [])])
    _check_spans(seen.angle, raw)
    protocol = setup.protocol
    rows, runs, unsure = raw.on_one_clock(protocol.wrap * SECOND[protocol.unit])
    torque = _torque(rows, measured, mechanism, wanted.hold)
    shown = _exposure(document)
    marker = _marked(seen, rows, wanted, str(angles), shown) if wanted.marker else None
    known = _known(marker, wanted, seen)
    try:
        found = align(setup.mechanism or {}, seen.angle, torque, known=known)
    except InputError as error:
        if marker is None or known is None:
            raise
        errors = marker.error, marker.drift_error
        found = by_marker(known, errors, seen.angle, torque, str(error))
    moved = torque._replace(time=found.clock.to_angles(torque.time))
    angle = cut(seen.angle, moved.time[0], moved.time[-1])
    command = _command(rows, setup)
    sources = {
        angles.name: seen.sha256,
        log.name: hashlib.sha256(content_of(log)).hexdigest(),
    }
    return Aligned(
        mechanism,
        angle,
        around(moved, angle.time[0], angle.time[-1]),
        None if command is None else command._replace(time=found.clock.to_angles(command.time)),
        found,
        marker,
        _drives(rows, setup, measured, found.span),
        sources,
        tuple(_remarks(seen.angle, angle, runs, unsure)),
    )


def head(one: Aligned, rig: Path, hold: str) -> dict[str, Any]:
    """What all recordings of the data set share."""
    return head_of(
        rig_settings_of(rig_tables(rig), str(rig)).mechanism or {},
        one.mechanism.description.driven,
        hold,
    )


def check_out(folder: Path, name: str, rig: Path, hold: str, replace: bool) -> None:
    """Complain about a place that cannot be written, before anything is computed."""
    document = rig_tables(rig)
    setup = rig_settings_of(document, str(rig))
    driven = _mechanism(setup, document).description.driven
    check_place(folder, name, head_of(setup.mechanism or {}, driven, hold), replace)


def write(one: Aligned, folder: Path, name: str, rig: Path, hold: str) -> None:
    """Add the recording to a data set."""
    add_recording(folder, name, head(one, rig, hold), one.angle, one.torque)


def _mechanism(setup: RigSettings, document: Mapping[str, Any]) -> Mechanism:
    if setup.mechanism is None or "kind" not in document["mechanism"]:
        raise InputError(f"{setup.file}: the table [mechanism] is missing; add it with its kind")
    mechanism = mechanism_of(setup.mechanism)
    motors = sum(mechanism.description.driven)
    if motors != len(setup.motors):
        raise InputError(
            f"{setup.file}: [motor] has {len(setup.motors)} motors, the mechanism "
            f"{mechanism.description.kind!r} drives {motors} joints"
        )
    return mechanism


def _torque(rows: Log, measured: list[str], mechanism: Mechanism, hold: str) -> Signal:
    value = np.zeros((len(rows.columns["time"]), mechanism.n))
    for j, name in zip(np.flatnonzero(mechanism.description.driven), measured, strict=True):
        value[:, j] = rows.columns[name]
    return Signal(rows.columns["time"], value, hold)


def _command(rows: Log, setup: RigSettings) -> Signal | None:
    names = [m.command for m in setup.motors]
    if not all(name in rows.columns for name in names):
        return None
    factors = [m.per_command for m in setup.motors]
    value = np.stack([rows.columns[n] * f for n, f in zip(names, factors, strict=True)], axis=1)
    return Signal(rows.columns["time"], value, "previous")


def _drives(
    rows: Log, setup: RigSettings, measured: list[str], span: tuple[float, float]
) -> list[Response | None]:
    """Each motor's response during the motion, of those whose command is logged."""
    out = []
    moves = (rows.columns["time"] >= span[0]) & (rows.columns["time"] <= span[1])
    rows = Log(rows.file, {k: v[moves] for k, v in rows.columns.items()})
    for motor, name in zip(setup.motors, measured, strict=True):
        if motor.command in rows.columns:
            command = rows.columns[motor.command] * motor.per_command
            out.append(response(rows.columns["time"], command, rows.columns[name]))
    return out


def _check_spans(angle: Signal, log: Log) -> None:
    """Times of two computers that both count from 1970 must lie near each other."""
    host = log.columns["host"]
    if angle.time[0] < _EPOCH:
        return
    if angle.time[0] > host[-1] + _LOOSE or angle.time[-1] < host[0] - _LOOSE:
        apart = max(angle.time[0] - host[-1], host[0] - angle.time[-1])
        raise InputError(
            f"angles and log share no moment: by their clocks they are {apart:.0f} s apart; name "
            "the log of the same motion"
        )


def _exposure(document: Mapping[str, Any]) -> float:
    """Exposure [s] of the camera of a rig.toml, 0 where it is not told."""
    camera = document.get("camera")
    given = camera.get("exposure") if isinstance(camera, dict) else None
    return float(given) if isinstance(given, int | float) and given > 0 else 0.0


def _marked(seen: Angles, rows: Log, wanted: Wanted, file: str, exposure: float) -> Marked:
    assert seen.marker is not None
    camera = edges_of(seen.marker.time, seen.marker.value[:, 0], file, exposure)
    log = edges_of(rows.columns["time"], rows.columns[wanted.marker], rows.file)
    return marked(camera, log, wanted.offset)


def _known(marker: Marked | None, wanted: Wanted, seen: Angles) -> Clock | None:
    if marker is not None:
        return Clock(marker.offset, marker.drift, marker.at)
    if wanted.offset is None:
        return None
    middle = float(seen.angle.time[0] + seen.angle.time[-1]) / 2 - wanted.offset
    return Clock(wanted.offset, 0.0, middle)


def _remarks(seen: Signal, angle: Signal, runs: Runs, unsure: float) -> list[str]:
    out = []
    lost = len(seen.time) - len(angle.time)
    if lost:
        out.append(f"{lost} of {len(seen.time)} angles lie outside the log and are left out")
    count = int(runs.number.max(initial=0)) + 1
    if count > 1:
        sure = "" if unsure < _RUNS else ", which is not sure enough: log such motion again"
        out.append(
            f"the controller restarted {count - 1} times; its runs are joined by this computer's "
            f"clock to about {1e3 * unsure:.2g} ms{sure}"
        )
    dropped = int((~runs.kept).sum())
    if dropped:
        out.append(f"{dropped} rows with damaged or repeated times are left out")
    return out
