"""From a table of angles and a torque log to an aligned recording."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from frictionid.config import NonEmpty, Strict, checked
from frictionid.data.readers.column_toml import UNITS
from frictionid.data.readers.csv_table import joint_columns
from frictionid.data.readers.table import read_table, signal_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import TORQUE_HOLD, Signal, cut
from frictionid.errors import InputError
from frictionid.files import read_bytes, sha256
from frictionid.mechanics import Mechanism, mechanism_of
from frictionid.report.tables import render

from ..logfile import ClockRuns, Log, column_names, read_log
from ..rig_settings import RigSettings, load_rig_settings
from .clock import Alignment, Clock, align, by_marker
from .cross_correlation import around
from .drifting_clocks import MarkerClock, clock_from_edges, edges_of, lost_frames
from .drive_response import DriveResponse, drive_response

_EPOCH = 1e8  # [s]: later times count from 1970, as those of other computers do
_MAX_DIFFERENCE = 600.0  # [s] by which the clocks of two computers may differ
_GAPS = 5  # of lost frames, at most
_RUNS = 0.002  # [s]: restarts joined less precisely than this are reported as too uncertain


class Rig(NamedTuple):
    """A real rig: its mechanism, and the settings of its drive and camera."""

    mechanism: Mechanism
    settings: RigSettings

    @property
    def exposure(self) -> float:
        """Exposure [s] of the camera, 0 where it is not given."""
        camera = self.settings.tables.get("camera")
        exposure = camera.get("exposure") if isinstance(camera, dict) else None
        return float(exposure) if isinstance(exposure, int | float) and exposure > 0 else 0.0

    def head(self, hold: str) -> dict[str, Any]:
        """Tables that all recordings of a data set of this rig share."""
        return {
            "mechanism": dict(self.settings.tables["mechanism"]),
            "columns": joint_columns(self.mechanism.driven),
            "hold": {"torque": hold},
        }


@dataclass(frozen=True, eq=False, repr=False)
class Aligned:
    """A recording whose two files count from one instant.

    Attributes
    ----------
    name : of the recording
    mechanism : Mechanism
    angle : Signal, n columns
    torque : Signal, n columns, by the angles' clock
    command : Signal as it was logged, one column per motor, by the same clock, or None
    alignment : Alignment, offset and drift with their standard errors
    marker : MarkerClock, or None
    responses : of each motor, None where its command does not change
    sources : SHA-256 of the files
    warnings : sentences
    """

    name: str
    mechanism: Mechanism
    angle: Signal
    torque: Signal
    command: Signal | None
    alignment: Alignment
    marker: MarkerClock | None
    responses: list[DriveResponse | None]
    sources: dict[str, str]
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        return render("alignment.j2", vars(self), markup=False).rstrip("\n")

    @property
    def document(self) -> dict[str, Any]:
        """All numbers in SI units, intervals of 95 %: clock, responses, and hashes of the files."""
        a, marker = self.alignment, self.marker
        clock, t = a.clock, a.t_quantile
        offset, drift = t * a.error_at(clock.at), t * a.drift_error
        out: dict[str, Any] = {
            "clock": {
                "offset": clock.offset,
                "offset_interval": [clock.offset - offset, clock.offset + offset],
                "at": clock.at,
                "drift": clock.drift,
                "drift_interval": [clock.drift - drift, clock.drift + drift],
                "span": list(a.span),
                "converged": a.converged,
            },
            "sources": self.sources,
        }
        if not a.marker_only:
            slope = a.viscous_slope.tolist()
            out["viscous"] = {"estimate": a.viscous.tolist(), "per_second_of_offset": slope}
        if marker is not None:
            out["marker"] = {k: float(v) for k, v in marker._asdict().items()}
        out["warnings"] = list(self.warnings)
        out["command"] = [_response_table(r) for r in self.responses if r is not None]
        return out

    @cached_property
    def dataset(self) -> Dataset:
        """The recording as a data set."""
        recording = Recording(self.name, self.angle, self.torque)
        return Dataset(self.name, self.mechanism, (recording,))


def _response_table(r: DriveResponse) -> dict[str, Any]:
    levels = {
        name: level for name, level in (("low", r.low), ("high", r.high)) if np.isfinite(level)
    }
    return {"gain": r.gain, "bias": r.bias, "delay": r.delay, "errors": r.error.tolist(), **levels}


def load_rig(path: Path) -> Rig:
    """Rig of a rig.toml.

    Raises
    ------
    InputError
        Without a [mechanism], or where its motors are not those of the drive.
    """
    settings = load_rig_settings(path)
    table = settings.tables.get("mechanism")
    if not isinstance(table, dict) or "kind" not in table:
        raise InputError(f"{path}: the table [mechanism] is missing; add it with its kind")
    mechanism = mechanism_of(table)
    driven = sum(mechanism.driven)
    if driven != len(settings.motors):
        raise InputError(
            f"{path}: [motor] has {len(settings.motors)} motors, the mechanism "
            f"{mechanism.kind!r} drives {driven} joints"
        )
    return Rig(mechanism, settings)


def align_files(
    angles: Path,
    log: Path,
    rig: Rig,
    *,
    name: str = "",
    marker: str = "",
    offset: float | None = None,
    hold: str = TORQUE_HOLD,
) -> Aligned:
    """Recording of a table of angles and a torque log, on the angles' clock.

    Parameters
    ----------
    name : of the recording
    marker : column of both files with state or brightness of a sync LED, or ""
    offset : [s], to within 0.5 s, where it is known
    hold : the logged torque between two rows, "linear" or "previous"

    Raises
    ------
    InputError
        For damaged files, and where the clocks cannot be aligned.
    """
    seen, led = read_angles(angles, rig.settings.tables.get("angles", {}), rig.mechanism.n, marker)
    raw = _with_torques(read_log(log, [marker] if marker else []), rig.settings)
    _check_spans(seen, raw)
    protocol = rig.settings.protocol
    rows, runs, uncertainty = raw.unified(protocol.wrap * UNITS["time"][protocol.unit])
    torque = _torque(rows, rig, hold)
    gaps: list[tuple[float, float]] = []
    while True:
        edges = None
        if led is not None:
            camera = edges_of(led.time, led.value[:, 0], str(angles), rig.exposure)
            drive = edges_of(rows.columns["time"], rows.columns[marker], rows.file)
            edges = clock_from_edges(camera, drive, offset)
        alignment = _aligned(seen, torque, rig.mechanism, edges, offset)
        gap = lost_frames(seen, alignment.step) if alignment.step else None
        if gap is None or len(gaps) == _GAPS:
            break
        gaps.append(gap)
        seen, led = _opened(seen, *gap), None if led is None else _opened(led, *gap)
    moved = torque._replace(time=alignment.clock.to_angles(torque.time))
    angle = cut(seen, moved.time[0], moved.time[-1])
    return Aligned(
        name=name,
        mechanism=rig.mechanism,
        angle=angle,
        torque=around(moved, angle.time[0], angle.time[-1]),
        command=_command(rows, rig, alignment.clock),
        alignment=alignment,
        marker=edges,
        responses=_responses(rows, rig, alignment.span),
        sources={p.name: sha256(read_bytes(p)) for p in (angles, log)},
        warnings=(*_warnings(gaps, alignment.step, seen, angle, runs, uncertainty),),
    )


def _with_torques(log: Log, settings: RigSettings) -> Log:
    """The log with the torque of each motor, of a current where the log has no torque."""
    columns = dict(log.columns)
    for name, motor in zip(settings.torque_columns(), settings.motors, strict=True):
        if name not in columns and motor.measured not in columns:
            raise InputError(
                f"{log.file} has no column {name!r}, nor {motor.measured!r} of [motor]; it has "
                f"{', '.join(columns)}"
            )
        if name not in columns:
            columns[name] = motor.per_measured * columns[motor.measured]
    return log._replace(columns=columns)


def _opened(signal: Signal, time: float, gap: float) -> Signal:
    """A signal whose samples after a time come later by a gap [s]."""
    return signal._replace(time=signal.time + gap * (signal.time > time))


def _warnings(
    gaps: list[tuple[float, float]],
    step: tuple[float, float] | None,
    seen: Signal,
    angle: Signal,
    runs: ClockRuns,
    uncertainty: float,
) -> Iterator[str]:
    for time, gap in gaps:
        yield (
            f"frames seem to be lost at {time:.2f} s: the clock steps by {1e3 * gap:.1f} ms, by "
            "which later angles are moved"
        )
    if step is not None:
        yield (
            f"the clock steps by {1e3 * step[1]:.1f} ms near {step[0]:.1f} s, which no drift "
            "describes: align the motion before and after it apart"
        )
    lost = len(seen.time) - len(angle.time)
    if lost:
        yield f"{lost} of {len(seen.time)} angles lie outside the log and are left out"
    _, number, kept = runs
    restarts = int(number.max(initial=0))
    if restarts:
        advice = "" if uncertainty < _RUNS else ", which is too uncertain: log such motion again"
        yield (
            f"the controller restarted {restarts} times; its runs are joined by this computer's "
            f"clock to about {1e3 * uncertainty:.2g} ms{advice}"
        )
    dropped = int((~kept).sum())
    if dropped:
        yield f"{dropped} rows with damaged or repeated times are left out"


def _aligned(
    angle: Signal,
    torque: Signal,
    mechanism: Mechanism,
    marker: MarkerClock | None,
    offset: float | None,
) -> Alignment:
    """By the motion, from the marker or a rough offset; by the marker alone where that fails."""
    clock = None
    if marker is not None:
        clock = Clock(marker.offset, marker.drift, marker.at)
    elif offset is not None:
        clock = Clock(offset, 0.0, float(angle.time[0] + angle.time[-1]) / 2 - offset)
    try:
        return align(mechanism, angle, torque, start=clock)
    except InputError as error:
        if marker is None or clock is None:
            raise
        errors = marker.error, marker.drift_error
        return by_marker(clock, errors, angle, torque, str(error))


def _torque(rows: Log, rig: Rig, hold: str) -> Signal:
    """Measured torque of all joints, zero where there is no motor."""
    value = np.zeros((len(rows.columns["time"]), rig.mechanism.n))
    for j, name in zip(
        np.flatnonzero(rig.mechanism.driven), rig.settings.torque_columns(), strict=True
    ):
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
    for motor, name in zip(rig.settings.motors, rig.settings.torque_columns(), strict=True):
        if motor.command in rows.columns:
            command = rows.columns[motor.command][moves] * motor.per_command
            out.append(drive_response(time[moves], command, rows.columns[name][moves]))
    return out


def _check_spans(angle: Signal, log: Log) -> None:
    """Times of two computers that both count from 1970 must lie near each other."""
    host = log.columns["host"]
    if min(angle.time[0], host[0]) < _EPOCH:
        return
    difference = max(angle.time[0] - host[-1], host[0] - angle.time[-1])
    if difference > _MAX_DIFFERENCE:
        raise InputError(
            f"angles and log share no moment: by their clocks they are {difference:.0f} s apart; "
            "name the log of the same motion"
        )


_TIMES = ("time", "time_camera", "time_angle")
_MIN_ROWS = 10


class AngleColumns(Strict):
    """The [angles] table of rig.toml: columns of a table of angles.

    time : [s]; columns : one per joint; sigma : standard deviation of each; unit : of both
    """

    time: str = ""
    columns: NonEmpty[str] | None = None
    sigma: NonEmpty[str] | None = None
    unit: Literal["rad", "mrad", "deg", "rev", "m", "mm"] = "rad"


def read_angles(
    path: Path, settings: Mapping[str, Any], joints: int, marker: str = ""
) -> tuple[Signal, Signal | None]:
    """Angles (n columns) of a file by the camera's clock, and its sync LED where a marker is named.

    Rows without all angles (a lost dot, another clock) are left out of the angles, not of the LED.

    settings : the [angles] table; marker : column of a sync LED, or ""

    Raises
    ------
    InputError
        Where columns are missing, or times do not increase.
    """
    columns = checked(AngleColumns, settings, "[angles]")
    content, file = read_bytes(path), str(path)
    header = column_names(content)
    time = columns.time or next((t for t in _TIMES if t in header), _TIMES[0])
    usual = [f"sigma{j + 1}" for j in range(joints)]
    names = columns.columns or [f"q{j + 1}" for j in range(joints)]
    sigma = columns.sigma or (usual if set(usual) <= set(header) else [])
    for key, listed in (("columns", names), ("sigma", sigma)):
        if len(listed) != joints and (listed or key == "columns"):
            raise InputError(
                f"[angles] {key} = {listed} must name one column for each of {joints} joints"
            )
    table = read_table(content, file, [time, *names, *sigma, *([marker] if marker else [])])
    complete = table.complete([time, *names])
    if len(complete.rows) < _MIN_ROWS:
        raise InputError(
            f"{file} has {len(complete.rows)} rows with all of {', '.join((time, *names))}; "
            "an alignment needs some seconds of motion"
        )
    unit = UNITS["angle"][columns.unit]
    angle = signal_of(complete, time, names, unit=unit)
    if sigma:
        angle = angle._replace(sigma=signal_of(complete, time, sigma, unit=unit).value)
    if not marker:
        return angle, None
    lit = table.complete([time, marker])
    if len(lit.rows) < 2:
        raise InputError(f"{file}: the column {marker!r} is empty; name another --marker")
    return angle, signal_of(lit, time, [marker])
