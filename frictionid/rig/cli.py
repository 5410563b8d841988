"""frictionid track, render, align, log, excite, simulate-drive: films, clocks and drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from frictionid.cli.options import DatasetPath, Json, Replace, present

Port = Annotated[str, typer.Option(help="Serial port, e.g. /dev/ttyUSB0.")]
LogFile = Annotated[Path, typer.Option(help="Log to write (CSV).")]
DriveRig = Annotated[Path, typer.Option(help="Settings with the tables [motor] and [protocol].")]
Baud = Annotated[int | None, typer.Option(min=1, help="In place of [protocol] baud.")]
Append = Annotated[bool, typer.Option("--append", help="Continue an existing log.")]
RIG = Path("rig.toml")


def track(
    video: Annotated[str, typer.Argument(help="Video, folder of pictures, or a camera's number.")],
    rig: Annotated[
        Path, typer.Option(help="Settings with markers, links and camera; written by --setup.")
    ] = RIG,
    out: Annotated[Path | None, typer.Option(help="Table of angles to write (CSV).")] = None,
    setup: Annotated[
        bool, typer.Option("--setup", help="Propose dots, pivot and links; write them to --rig.")
    ] = False,
    method: Annotated[
        Literal["follow", "study"],
        typer.Option(help="study: thresholds in the whole picture, for comparison."),
    ] = "follow",
    overlay: Annotated[
        Path | None, typer.Option(help="Video with markers and angles drawn over it (.mp4).")
    ] = None,
    sheet: Annotated[Path | None, typer.Option(help="Contact sheet of it (.png).")] = None,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Track coloured dots in a video; write joint angles with their standard deviations."""
    from frictionid.errors import InputError

    if setup:
        return _propose(video, rig, replace, json)
    if out is None:
        raise InputError("--out is missing: name the table of angles to write, such as angles.csv")
    from frictionid.cli.progress import counted, show
    from frictionid.outputs import check_outputs
    from frictionid.rig.camera.marker_setup import load_marker_setup
    from frictionid.rig.camera.source import open_source
    from frictionid.rig.camera.tracked import track as track_video

    check_outputs((out, sheet, overlay), (Path(video), rig), replace=replace)
    markers = load_marker_setup(rig)
    source = open_source(video, markers.camera.rate)
    if source.kind == "live" and (overlay or sheet):
        raise InputError("--overlay and --sheet need a video: a live camera shows its frames once")
    with counted(source.count or 0, source.name) as count:
        tracked = track_video(source, markers, method=method, done=lambda _: count(""))
    tracked.save(out)
    if sheet is not None:
        tracked.save_sheet(sheet)
    if overlay is not None:
        tracked.save_overlay(overlay)
    show(tracked, tracked.document, (out, sheet, overlay), json=json)
    return None


def _propose(video: str, rig: Path, replace: bool, json: bool) -> None:
    import tomllib

    from frictionid.cli.progress import show
    from frictionid.files import write_text
    from frictionid.outputs import check_outputs
    from frictionid.rig.camera.marker_setup import marker_setup_text
    from frictionid.rig.camera.propose import propose
    from frictionid.rig.camera.source import open_source

    check_outputs([rig], [Path(video)], replace=replace)
    markers = propose(open_source(video))
    notes = [
        f"proposed from {Path(video).name}; check it with frictionid track ... --sheet",
        "give links.lengths [m] where you know them: they check the order and calibrate the view",
    ]
    text = marker_setup_text(markers, notes)
    write_text(rig, text)
    lines = []
    for marker in markers.markers:
        dot = f"hue {marker.hue or 0:.0f} deg, radius {marker.radius:.1f} px"
        place = f"at {marker.at[0]:.1f}, {marker.at[1]:.1f}" if marker.at else ""
        lines.append(f"{marker.name}: {place if marker.hue is None else dot}")
    lengths = ", ".join(f"{p:.1f}" for p in markers.links.pixels or ())
    show("\n".join([*lines, f"links: {lengths} px"]), tomllib.loads(text), [rig], json=json)


def render(
    dataset: DatasetPath,
    camera: Annotated[Path, typer.Option(help="Settings of the simulated camera, a camera.toml.")],
    out: Annotated[Path, typer.Option(help="Folder of the videos to write.")],
    only: Annotated[list[str] | None, typer.Option(help="Recordings, all where none is named.")] = (
        None
    ),
    replace: Replace = False,
) -> None:
    """Render simulated recordings as videos of coloured dots."""
    from frictionid.cli.progress import counted
    from frictionid.config import nearest
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.errors import InputError
    from frictionid.outputs import check_outputs
    from frictionid.rig.camera.film import load_film, video_path, write_film

    film, data = load_film(camera), load_dataset(dataset)
    names = [r.name for r in data.recordings]
    for name in only or ():
        if name not in names:
            raise InputError(f"{dataset}: no recording {name!r}; {nearest(name, names)}")
    chosen = [r for r in data.recordings if not only or r.name in only]
    without = next((r.name for r in chosen if r.truth is None), None)
    if without is not None:
        raise InputError(f"{dataset}: {without!r} has no true motion; render simulated data sets")
    videos = [video_path(film, out / recording.name) for recording in chosen]
    check_outputs(videos, (*dataset_files(dataset), camera), replace=replace)
    with counted(len(chosen), data.name) as done:
        for recording in chosen:
            assert recording.truth is not None
            write_film(film, recording.truth, out / recording.name)
            done(recording.name)
    print(f"{len(chosen)} videos written to {out}")


def align(
    angles: Annotated[
        Path, typer.Argument(help="Table of angles by the camera's clock.", callback=present)
    ],
    torque: Annotated[Path, typer.Argument(help="Log of the drive.", callback=present)],
    out: Annotated[Path, typer.Option(help="Folder of the data set; a recording is added.")],
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [mechanism] and [motor].")
    ] = RIG,
    name: Annotated[str, typer.Option(help="Name of the recording [that of the angles].")] = "",
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a recording of that name.")
    ] = False,
    marker: Annotated[
        str, typer.Option(help="Column of both files with state or brightness of a sync LED.")
    ] = "",
    offset: Annotated[
        float | None, typer.Option(help="Offset to within 0.5 s, where it is known [s].")
    ] = None,
    hold: Annotated[
        str, typer.Option(help="The logged torque between two rows: previous, or linear.")
    ] = "previous",
    json: Json = False,
) -> None:
    """Estimate offset and drift between two clocks from the motion itself (docs/drive.md)."""
    from frictionid.cli.progress import show
    from frictionid.rig.align.recording_folder import align as align_recording

    aligned = align_recording(
        *(angles, torque, rig),
        name=name,
        marker=marker,
        offset=offset,
        hold=hold,
        folder=out,
        replace=replace,
    )
    counts = f"{aligned.name}: {len(aligned.angle.time)} angles, {len(aligned.torque.time)} torques"
    show(f"{aligned}\n{counts}", aligned.document, [out], json=json)


def log(
    port: Port,
    out: LogFile,
    rig: DriveRig = RIG,
    baud: Baud = None,
    append: Append = False,
    seconds: Annotated[
        float | None, typer.Option(min=0, help="Duration [s]; by default Ctrl-C ends it.")
    ] = None,
    patience: Annotated[
        float | None, typer.Option(min=0, help="End when no line has come for so long [s].")
    ] = None,
) -> None:
    """Log what a motor drive reports: its clock, command and torque (docs/drive.md)."""
    from frictionid.rig.log import (
        ProgressLine,
        counts_text,
        log_until,
        open_logger,
        stop_requests,
    )
    from frictionid.rig.rig_settings import load_rig_settings

    settings = load_rig_settings(rig)
    show = ProgressLine(settings.protocol.columns)
    with (
        stop_requests() as stop,
        open_logger(port, baud, settings, out, append=append) as logger,
        show,
    ):
        log_until(logger, stop, show, seconds, patience)
    print(counts_text(logger.counts))
    print(f"written to {out}")


def excite(
    port: Port,
    signal: Annotated[Path, typer.Option(help="Table: time [s], a torque per motor [N m].")],
    out: LogFile,
    rig: DriveRig = RIG,
    baud: Baud = None,
    rate: Annotated[float, typer.Option(help="Commands per second [Hz].")] = 100.0,
    ramp: Annotated[float, typer.Option(help="Time of the ramps up and down [s].")] = 0.3,
    silence: Annotated[float, typer.Option(help="Ramp down when the drive is silent [s].")] = 0.25,
    append: Append = False,
) -> None:
    """Play a torque signal to a drive and log what it reports; any key is an emergency stop.

    Ctrl-C ramps the torque down. The signal must stay within [motor] limit.
    """
    from frictionid.rig.log import ProgressLine, counts_text, open_logger, stop_requests
    from frictionid.rig.playback import PlaySettings, keys, load_signal
    from frictionid.rig.playback import excite as play
    from frictionid.rig.rig_settings import load_rig_settings

    settings = load_rig_settings(rig)
    torque, how = load_signal(signal, settings), PlaySettings(rate, ramp, silence)
    show = ProgressLine(settings.protocol.columns)
    with (
        stop_requests() as asked,
        keys() as key,
        open_logger(port, baud, settings, out, append=append) as logger,
        show,
    ):

        def stop() -> str:
            pressed = key()
            if pressed:
                return f"emergency stop by the key {pressed!r}"
            return "ramp" if asked() else ""

        reason = play(logger, torque, how, stop, show)
    print(counts_text(logger.counts))
    print(f"written to {out}")
    if reason:
        print(f"not played to its end: {reason}")
        raise typer.Exit(1)


def simulate_drive(
    dataset: Annotated[Path, typer.Argument(help="Data set with the torque to play.")],
    port: Annotated[Path, typer.Option(help="Name of the port to make, e.g. /tmp/drive.")],
    recording: Annotated[str, typer.Option(help="Recording to play [the first].")] = "",
    rig: DriveRig = RIG,
    rate: Annotated[float, typer.Option(help="Lines per second [Hz].")] = 1000.0,
    speed: Annotated[
        float, typer.Option(help="Times real time; inf: as fast as it is read.")
    ] = 1.0,
    offset: Annotated[
        float, typer.Option(help="Zero of its clock by the angles' clock [s].")
    ] = 0.0,
    drift: Annotated[
        float, typer.Option(help="Drift of its clock, positive where slow [ppm].")
    ] = 0.0,
    gain: Annotated[float, typer.Option(help="Measured over commanded torque.")] = 1.0,
    bias: Annotated[float, typer.Option(help="Measured torque at zero command [N m].")] = 0.0,
    lag: Annotated[float, typer.Option(help="Delay of the measured torque [s].")] = 0.0,
    noise: Annotated[float, typer.Option(help="Noise of the measured torque [N m].")] = 0.0,
    damaged: Annotated[float, typer.Option(help="Share of damaged lines.")] = 0.0,
    unplugged: Annotated[int, typer.Option(help="Number of times that the cable is pulled.")] = 0,
    restarts: Annotated[int, typer.Option(help="Number of restarts of the controller.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of faults and noise.")] = 0,
    sent: Annotated[Path | None, typer.Option(help="File for the undamaged lines.")] = None,
    replace: Replace = False,
) -> None:
    """Play the torque of a recording as a drive would report it, and obey commands."""
    import contextlib

    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.errors import InputError
    from frictionid.outputs import check_outputs
    from frictionid.rig.rig_settings import load_rig_settings
    from frictionid.rig.virtual_drive import Drive, Faults, torque_of
    from frictionid.rig.virtual_port import Terminal, play

    if not speed > 0:
        raise InputError(f"--speed {speed:g} must be positive")
    drive = Drive(
        rig=load_rig_settings(rig),
        torque=torque_of(load_dataset(dataset), recording),
        rate=rate,
        offset=offset,
        drift=1e-6 * drift,
        gain=gain,
        bias=bias,
        lag=lag,
        noise=noise,
        faults=Faults(damaged, unplugged, restarts, seed),
    )
    with contextlib.ExitStack() as stack:
        check_outputs([sent], (*dataset_files(dataset), rig), replace=replace)
        if sent is not None:
            sent.parent.mkdir(parents=True, exist_ok=True)
        file = stack.enter_context(sent.open("wb")) if sent else None
        terminal = Terminal(port)
        stack.callback(terminal.unplug)
        print(f"{drive.lines} lines at {port}, as soon as it is opened", flush=True)
        good = play(drive, terminal, speed=speed, sent=file)
    print(f"{good} undamaged lines were sent")
