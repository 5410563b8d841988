"""frictionid excite: play a torque signal to a drive, within limits, and log its answer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


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
