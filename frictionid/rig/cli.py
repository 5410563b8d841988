"""frictionid track, render, align, log, excite, simulate-drive: films, clocks and drives."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Literal

import typer

import frictionid as fid
from frictionid.cli.command import DatasetPath, PresentPath, check_files, counted, show
from frictionid.errors import InputError

RIG = Path("rig.toml")


def track(
    video: str,
    *,
    rig: Path = RIG,
    out: Path | None = None,
    setup: bool = False,
    method: Literal["follow", "study"] = "follow",
    overlay: Path | None = None,
    sheet: Path | None = None,
    json: bool = False,
    replace: bool = False,
) -> None:
    """Track coloured dots in a video; write joint angles with their standard deviations.

    Parameters
    ----------
    video : Video, folder of pictures, or a camera's number.
    rig : Settings with markers, links and camera; written by --setup.
    out : Table of angles to write (CSV).
    setup : Propose dots, pivot and links; add them to --rig.
    method : study: thresholds in the whole picture, for comparison.
    overlay : Video with markers and angles drawn over it (.mp4).
    sheet : Contact sheet of it (.png).
    """
    if setup:
        return _propose(video, rig, replace, json)
    if out is None:
        raise InputError("--out is missing: name the table of angles to write, such as angles.csv")
    from frictionid.outputs import check_outputs

    from .camera.marker_setup import load_marker_setup
    from .camera.source import open_source

    check_outputs((out, sheet, overlay), (Path(video), rig), replace=replace)
    markers = load_marker_setup(rig)
    source = open_source(video, markers.camera.rate)
    if source.kind == "live" and (overlay or sheet):
        raise InputError("--overlay and --sheet need a video: a live camera shows its frames once")
    with counted(source.count or 0, source.name) as count:
        tracked = fid.track(source, markers, method=method, done=lambda _: count(""))
    tracked.save(out)
    if sheet is not None:
        tracked.save_sheet(sheet)
    if overlay is not None:
        tracked.save_overlay(overlay)
    show(tracked, tracked.document, (out, sheet, overlay), json=json)
    return None


def _propose(video: str, rig: Path, replace: bool, json: bool) -> None:
    import tomllib

    import tomli_w

    from frictionid.files import write_text
    from frictionid.outputs import check_outputs

    from .camera.marker_setup import marker_setup_text
    from .camera.propose import propose
    from .camera.source import open_source
    from .rig_settings import rig_tables

    there = rig_tables(rig) if rig.is_file() else {}
    taken = bool({"markers", "links"} & there.keys())
    check_outputs([rig], [Path(video)], replace=replace or not taken)
    markers = propose(open_source(video))
    notes = [
        f"proposed from {Path(video).name}; check it with frictionid track ... --sheet",
        "give links.lengths [m] where you know them: they check the order and calibrate the view",
    ]
    text = marker_setup_text(markers, notes)
    tables = tomllib.loads(text)
    if taken:
        text = tomli_w.dumps({**there, **tables})
    elif rig.is_file():
        text = f"{rig.read_text(encoding='utf-8')}\n{text}"
    write_text(rig, text)
    lines = []
    for marker in markers.markers:
        dot = f"hue {marker.hue or 0:.0f} deg, radius {marker.radius:.1f} px"
        place = f"at {marker.at[0]:.1f}, {marker.at[1]:.1f}" if marker.at else ""
        lines.append(f"{marker.name}: {place if marker.hue is None else dot}")
    lengths = ", ".join(f"{p:.1f}" for p in markers.links.pixels or ())
    show("\n".join([*lines, f"links: {lengths} px"]), tables, [rig], json=json)


def render(
    dataset: DatasetPath,
    *,
    camera: Path,
    out: Path,
    only: list[str] | None = None,
    replace: bool = False,
) -> None:
    """Render simulated recordings as videos of coloured dots.

    Parameters
    ----------
    camera : Settings of the simulated camera, a camera.toml.
    out : Folder of the videos to write.
    only : Recordings, all where none is named.
    """
    from .camera.film import load_film, video_path, write_film

    film, data = load_film(camera), fid.load_dataset(dataset)
    chosen = [data[name] for name in only] if only else data.recordings
    without = next((r.name for r in chosen if r.truth is None), None)
    if without is not None:
        raise InputError(f"{dataset}: {without!r} has no true motion; render simulated data sets")
    videos = [video_path(film, out / recording.name) for recording in chosen]
    check_files(videos, [camera], dataset, replace=replace)
    with counted(len(chosen), data.name) as done:
        for recording in chosen:
            assert recording.truth is not None
            write_film(film, recording.truth, out / recording.name)
            done(recording.name)
    print(f"{len(chosen)} videos written to {out}")


def align(
    angles: PresentPath,
    torque: PresentPath,
    *,
    out: Path,
    rig: Path = RIG,
    name: str = "",
    replace: bool = False,
    marker: str = "",
    offset: float | None = None,
    hold: str = "previous",
    json: bool = False,
) -> None:
    """Estimate offset and drift between two clocks from the motion itself (docs/drive.md).

    Parameters
    ----------
    angles : Table of angles by the camera's clock.
    torque : Log of the drive.
    out : Folder of the data set; a recording is added.
    rig : Settings with the tables [mechanism] and [motor].
    name : Name of the recording [that of the angles].
    replace : Replace a recording of that name.
    marker : Column of both files with state or brightness of a sync LED.
    offset : Offset to within 0.5 s, where it is known [s].
    hold : The logged torque between two rows: previous, or linear.
    """
    aligned = fid.align(
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
    *,
    port: str,
    out: Path,
    rig: Path = RIG,
    append: bool = False,
    seconds: Annotated[float | None, typer.Option(min=0)] = None,
    patience: Annotated[float | None, typer.Option(min=0)] = None,
) -> None:
    """Log what a motor drive reports: its clock, command and torque (docs/drive.md).

    Parameters
    ----------
    port : Serial port, e.g. /dev/ttyUSB0.
    out : Log to write (CSV).
    rig : Settings with the tables [motor] and [protocol].
    append : Continue an existing log.
    seconds : Duration [s]; by default Ctrl-C ends it.
    patience : End when no line has come for so long [s].
    """
    from .log import log_until, open_logger, stop_requests
    from .rig_settings import load_rig_settings

    settings = load_rig_settings(rig)
    with stop_requests() as stop, open_logger(port, settings, out, append=append) as logger:
        log_until(logger, stop, seconds, patience)


def excite(
    *,
    port: str,
    signal: Path,
    out: Path,
    rig: Path = RIG,
    rate: float = 100.0,
    ramp: float = 0.3,
    silence: float = 0.25,
    append: bool = False,
) -> None:
    """Play a torque signal to a drive and log what it reports; any key is an emergency stop.

    Ctrl-C ramps the torque down. The signal must stay within [motor] limit.

    Parameters
    ----------
    port : Serial port, e.g. /dev/ttyUSB0.
    signal : Table: time [s], a torque per motor [N m].
    out : Log to write (CSV).
    rig : Settings with the tables [motor] and [protocol].
    rate : Commands per second [Hz].
    ramp : Time of the ramps up and down [s].
    silence : Ramp down when the drive is silent [s].
    append : Continue an existing log.
    """
    from .log import open_logger, stop_requests
    from .playback import PlaySettings, keys, load_signal
    from .playback import excite as play
    from .rig_settings import load_rig_settings

    settings = load_rig_settings(rig)
    torque, how = load_signal(signal, settings), PlaySettings(rate, ramp, silence)
    with (
        stop_requests() as asked,
        keys() as key,
        open_logger(port, settings, out, append=append) as logger,
    ):

        def stop() -> str:
            pressed = key()
            if pressed:
                return f"emergency stop by the key {pressed!r}"
            return "ramp" if asked() else ""

        reason = play(logger, torque, how, stop)
    if reason:
        print(f"not played to its end: {reason}")
        raise typer.Exit(1)


def simulate_drive(
    dataset: Path,
    *,
    port: Path,
    recording: str = "",
    rig: Path = RIG,
    rate: float = 1000.0,
    speed: float = 1.0,
    offset: float = 0.0,
    drift: float = 0.0,
    gain: float = 1.0,
    bias: float = 0.0,
    lag: float = 0.0,
    noise: float = 0.0,
    damaged: float = 0.0,
    unplugged: int = 0,
    restarts: int = 0,
    seed: int = 0,
    sent: Path | None = None,
    replace: bool = False,
) -> None:
    """Play the torque of a recording as a drive would report it, and obey commands.

    Parameters
    ----------
    dataset : Data set with the torque to play.
    port : Name of the port to make, e.g. /tmp/drive.
    recording : Recording to play [the first].
    rig : Settings with the tables [motor] and [protocol].
    rate : Lines per second [Hz].
    speed : Times real time; inf: as fast as it is read.
    offset : Zero of its clock by the angles' clock [s].
    drift : Drift of its clock, positive where slow [ppm].
    gain : Measured over commanded torque.
    bias : Measured torque at zero command [N m].
    lag : Delay of the measured torque [s].
    noise : Noise of the measured torque [N m].
    damaged : Share of damaged lines.
    unplugged : Number of times that the cable is pulled.
    restarts : Number of restarts of the controller.
    seed : Seed of faults and noise.
    sent : File for the undamaged lines.
    """
    from .playback import torque_of
    from .rig_settings import load_rig_settings
    from .virtual_drive import Drive, Playback, Terminal

    if not speed > 0:
        raise InputError(f"--speed {speed:g} must be positive")
    drive = Drive(
        rig=load_rig_settings(rig),
        torque=torque_of(fid.load_dataset(dataset), recording),
        rate=rate,
        offset=offset,
        drift=1e-6 * drift,
        gain=gain,
        bias=bias,
        lag=lag,
        noise=noise,
        damaged=damaged,
        unplugged=unplugged,
        restarts=restarts,
        seed=seed,
    )
    with ExitStack() as stack:
        check_files([sent], [rig], dataset, replace=replace)
        if sent is not None:
            sent.parent.mkdir(parents=True, exist_ok=True)
        file = stack.enter_context(sent.open("wb")) if sent else None
        terminal = Terminal(port)
        stack.callback(terminal.unplug)
        print(f"{drive.lines} lines at {port}, as soon as it is opened", flush=True)
        good = Playback(drive, terminal, speed=speed, sent=file).run()
    print(f"{good} undamaged lines were sent")
