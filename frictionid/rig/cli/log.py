"""frictionid log, excite and simulate-drive: a motor drive, or a simulated one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Replace


def log(
    port: Annotated[str, typer.Option(help="Serial port, e.g. /dev/ttyUSB0.")],
    out: Annotated[Path, typer.Option(help="Log to write (CSV).")],
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [motor] and [protocol].")
    ] = Path("rig.toml"),
    baud: Annotated[int | None, typer.Option(min=1, help="In place of [protocol] baud.")] = None,
    append: Annotated[bool, typer.Option("--append", help="Continue an existing log.")] = False,
    seconds: Annotated[
        float | None, typer.Option(min=0, help="Duration [s]; by default Ctrl-C ends it.")
    ] = None,
    patience: Annotated[
        float | None, typer.Option(min=0, help="End when no line has come for so long [s].")
    ] = None,
) -> None:
    """Log what a motor drive reports: its clock, command and torque (docs/drive.md)."""
    from frictionid.rig.log import open_logger
    from frictionid.rig.monitor import ProgressLine, counts_text, log_until, stop_requests
    from frictionid.rig.rig_settings import load_rig_settings

    settings = load_rig_settings(rig)
    show = ProgressLine(settings.protocol.format().columns)
    with (
        stop_requests() as stop,
        open_logger(port, baud, settings, out, append=append) as logger,
        show,
    ):
        log_until(logger, stop, show, seconds, patience)
    print(counts_text(logger.counts))
    print(f"written to {out}")


def excite(
    port: Annotated[str, typer.Option(help="Serial port, e.g. /dev/ttyUSB0.")],
    signal: Annotated[Path, typer.Option(help="Table: time [s], a torque per motor [N m].")],
    out: Annotated[Path, typer.Option(help="Log to write (CSV).")],
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [motor] and [protocol].")
    ] = Path("rig.toml"),
    baud: Annotated[int | None, typer.Option(min=1, help="In place of [protocol] baud.")] = None,
    rate: Annotated[float, typer.Option(help="Commands per second [Hz].")] = 100.0,
    ramp: Annotated[float, typer.Option(help="Time of the ramps up and down [s].")] = 0.3,
    silence: Annotated[float, typer.Option(help="Ramp down when the drive is silent [s].")] = 0.25,
    append: Annotated[bool, typer.Option("--append", help="Continue an existing log.")] = False,
) -> None:
    """Play a torque signal to a drive and log what it reports; any key is an emergency stop.

    Ctrl-C ramps the torque down. The signal must stay within [motor] limit.
    """
    from frictionid.rig.log import open_logger
    from frictionid.rig.monitor import ProgressLine, counts_text, stop_requests
    from frictionid.rig.playback import PlaySettings, keys, load_signal
    from frictionid.rig.playback import excite as play
    from frictionid.rig.rig_settings import load_rig_settings

    settings = load_rig_settings(rig)
    torque, how = load_signal(signal, settings), PlaySettings(rate, ramp, silence)
    show = ProgressLine(settings.protocol.format().columns)
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
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [motor] and [protocol].")
    ] = Path("rig.toml"),
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
    from frictionid.rig.virtual_drive.controller import Drive, Faults, torque_of
    from frictionid.rig.virtual_drive.serve import Terminal, play, plugged

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
        terminal = stack.enter_context(plugged(Terminal(port)))
        print(f"{drive.lines} lines at {port}, as soon as it is opened", flush=True)
        good = play(drive, terminal, speed=speed, sent=file)
    print(f"{good} undamaged lines were sent")
