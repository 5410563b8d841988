"""From a table of angles and a torque log to an aligned recording."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.data.signals import TORQUE_HOLD, Signal, cut
from frictionid.errors import InputError
from frictionid.files import read_bytes
from frictionid.mechanics import Mechanism, mechanism_of
from frictionid.rig.align.clock import Alignment, Clock, align, by_marker
from frictionid.rig.align.cross_correlation import around
from frictionid.rig.align.drive_response import DriveResponse, drive_response
from frictionid.rig.align.recording_folder import MeasuredAngles, head_of, read_angles
from frictionid.rig.align.sync_edges import MarkerClock, clock_from_edges, edges_of
from frictionid.rig.logfile import ClockRuns, Log, read_log
from frictionid.rig.protocol import SECOND
from frictionid.rig.rig_settings import RigSettings, rig_settings_of, rig_tables

_EPOCH = 1e8  # [s]: later times count from 1970, as those of other computers do
_MAX_DIFFERENCE = 600.0  # [s] by which the clocks of two computers may differ
_RUNS = 0.002  # [s]: restarts joined less precisely than this are reported as too uncertain


@dataclass(frozen=True, eq=False)
class Rig:
    """A real rig: its mechanism and drive, and the tables of its rig.toml."""

    mechanism: Mechanism
    settings: RigSettings
    tables: dict[str, Any]

    @property
    def measured(self) -> list[str]:
        """Column of the log with the measured torque of each motor."""
        names = zip(self.settings.motors, self.settings.torque_columns(), strict=True)
        return [motor.torque or name for motor, name in names]

    @property
    def exposure(self) -> float:
        """Exposure [s] of the camera, 0 where it is not given."""
        camera = self.tables.get("camera")
        given = camera.get("exposure") if isinstance(camera, dict) else None
        return float(given) if isinstance(given, int | float) and given > 0 else 0.0

    def head(self, hold: str) -> dict[str, Any]:
        """Tables that all recordings of a data set of this rig share."""
        driven = self.mechanism.driven
        return head_of(self.tables["mechanism"], driven, hold)


@dataclass(frozen=True)
class AlignmentOptions:
    """Options of an alignment.

    Attributes
    ----------
    marker : column of both files with state or brightness of a sync LED, or ""
    offset : [s], to within 0.5 s, where it is known
    hold : the logged torque between two rows, "linear" or "previous"
    """

    marker: str = ""
    offset: float | None = None
    hold: str = TORQUE_HOLD


@dataclass(frozen=True, eq=False)
class AlignedRecording:
    """A recording from two files.

    Attributes
    ----------
    rig : Rig
    angle : Signal, n columns
    torque : Signal, n columns, by the angles' clock
    command : Signal as it was logged, one column per motor, by the same clock, or None
    alignment : Alignment
    marker : MarkerClock, or None
    responses : of each motor, None where its command does not change
    sources : SHA-256 of the files
    warnings : sentences
    """

    rig: Rig
    angle: Signal
    torque: Signal
    command: Signal | None
    alignment: Alignment
    marker: MarkerClock | None
    responses: list[DriveResponse | None]
    sources: dict[str, str]
    warnings: tuple[str, ...]

    @property
    def mechanism(self) -> Mechanism:
        """Mechanism of the rig."""
        return self.rig.mechanism


def load_rig(path: Path) -> Rig:
    """Rig of a rig.toml.

    Raises
    ------
    InputError
        Without a [mechanism], or where its motors are not those of the drive.
    """
    tables = rig_tables(path)
    settings = rig_settings_of(tables, str(path))
    if settings.mechanism is None or "kind" not in settings.mechanism:
        raise InputError(f"{path}: the table [mechanism] is missing; add it with its kind")
    mechanism = mechanism_of(settings.mechanism)
    driven = sum(mechanism.driven)
    if driven != len(settings.motors):
        raise InputError(
            f"{path}: [motor] has {len(settings.motors)} motors, the mechanism "
            f"{mechanism.kind!r} drives {driven} joints"
        )
    return Rig(mechanism, settings, tables)


def align_files(angles: Path, log: Path, rig: Rig, options: AlignmentOptions) -> AlignedRecording:
    """Recording of a table of angles and a torque log, on the angles' clock.

    Raises
    ------
    InputError
        For damaged files, and where the clocks cannot be aligned.
    """
    seen = read_angles(angles, rig.tables.get("angles", {}), rig.mechanism.n, options.marker)
    columns = [*rig.measured, *([options.marker] if options.marker else [])]
    raw = read_log(log, columns)
    _check_spans(seen.angle, raw)
    protocol = rig.settings.protocol
    rows, runs, uncertainty = raw.unified(protocol.wrap * SECOND[protocol.unit])
    torque = _torque(rows, rig, options.hold)
    marker = _marker(seen, rows, rig, options, str(angles)) if options.marker else None
    alignment = _aligned(seen.angle, torque, rig, marker, options)
    moved = torque._replace(time=alignment.clock.to_angles(torque.time))
    angle = cut(seen.angle, moved.time[0], moved.time[-1])
    return AlignedRecording(
        rig=rig,
        angle=angle,
        torque=around(moved, angle.time[0], angle.time[-1]),
        command=_command(rows, rig, alignment.clock),
        alignment=alignment,
        marker=marker,
        responses=_responses(rows, rig, alignment.span),
        sources={
            angles.name: seen.sha256,
            log.name: hashlib.sha256(read_bytes(log)).hexdigest(),
        },
        warnings=tuple(_warnings(seen.angle, angle, runs, uncertainty)),
    )


def _aligned(
    angle: Signal,
    torque: Signal,
    rig: Rig,
    marker: MarkerClock | None,
    options: AlignmentOptions,
) -> Alignment:
    """By the motion, from the marker or the given offset; by the marker alone where that fails."""
    known = None
    if marker is not None:
        known = Clock(marker.offset, marker.drift, marker.at)
    elif options.offset is not None:
        middle = float(angle.time[0] + angle.time[-1]) / 2 - options.offset
        known = Clock(options.offset, 0.0, middle)
    try:
        return align(rig.mechanism, angle, torque, known=known)
    except InputError as error:
        if marker is None or known is None:
            raise
        errors = marker.error, marker.drift_error
        return by_marker(known, errors, angle, torque, str(error))


def _torque(rows: Log, rig: Rig, hold: str) -> Signal:
    """Measured torque of all joints, zero where there is no motor."""
    value = np.zeros((len(rows.columns["time"]), rig.mechanism.n))
    for j, name in zip(np.flatnonzero(rig.mechanism.driven), rig.measured, strict=True):
        value[:, j] = rows.columns[name]
    return Signal(rows.columns["time"], value, hold)


def _command(rows: Log, rig: Rig, clock: Clock) -> Signal | None:
    """Commanded torque of all motors, None where a column is missing."""
    motors = rig.settings.motors
    if not all(m.command in rows.columns for m in motors):
        return None
    value = np.stack([rows.columns[m.command] * m.per_command for m in motors], axis=1)
    return Signal(clock.to_angles(rows.columns["time"]), value, "previous")


def _responses(rows: Log, rig: Rig, span: tuple[float, float]) -> list[DriveResponse | None]:
    """Response during the motion of each motor whose command is logged."""
    time = rows.columns["time"]
    moves = (time >= span[0]) & (time <= span[1])
    out = []
    for motor, name in zip(rig.settings.motors, rig.measured, strict=True):
        if motor.command in rows.columns:
            command = rows.columns[motor.command][moves] * motor.per_command
            out.append(drive_response(time[moves], command, rows.columns[name][moves]))
    return out


def _check_spans(angle: Signal, log: Log) -> None:
    """Times of two computers that both count from 1970 must lie near each other."""
    host = log.columns["host"]
    if angle.time[0] < _EPOCH:
        return
    difference = max(angle.time[0] - host[-1], host[0] - angle.time[-1])
    if difference > _MAX_DIFFERENCE:
        raise InputError(
            f"angles and log share no moment: by their clocks they are {difference:.0f} s apart; "
            "name the log of the same motion"
        )


def _marker(
    seen: MeasuredAngles, rows: Log, rig: Rig, options: AlignmentOptions, file: str
) -> MarkerClock:
    assert seen.marker is not None
    camera = edges_of(seen.marker.time, seen.marker.value[:, 0], file, rig.exposure)
    log = edges_of(rows.columns["time"], rows.columns[options.marker], rows.file)
    return clock_from_edges(camera, log, options.offset)


def _warnings(seen: Signal, angle: Signal, runs: ClockRuns, uncertainty: float) -> Iterator[str]:
    lost = len(seen.time) - len(angle.time)
    if lost:
        yield f"{lost} of {len(seen.time)} angles lie outside the log and are left out"
    restarts = int(runs.number.max(initial=0))
    if restarts:
        advice = "" if uncertainty < _RUNS else ", which is too uncertain: log such motion again"
        yield (
            f"the controller restarted {restarts} times; its runs are joined by this computer's "
            f"clock to about {1e3 * uncertainty:.2g} ms{advice}"
        )
    dropped = int((~runs.kept).sum())
    if dropped:
        yield f"{dropped} rows with damaged or repeated times are left out"
