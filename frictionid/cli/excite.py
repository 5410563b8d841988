"""frictionid excite: a torque signal played to a drive, with limits, and logged."""

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
    append: Annotated[bool, typer.Option("--append", help="Go on with an existing log.")] = False,
) -> None:
    """Play a torque signal to a drive and log what it reports; any key is an emergency stop.

    Ctrl-C ramps the torque down. The signal must stay within [motor] limit.
    """
    from functools import partial

    from frictionid.acquire.log import Logger
    from frictionid.acquire.logfile import Appender, Layout
    from frictionid.acquire.monitor import Shown, asked_to_stop, told
    from frictionid.acquire.playback import Playing, keys, load_signal
    from frictionid.acquire.playback import excite as play
    from frictionid.acquire.port import Port
    from frictionid.acquire.rig_settings import load_rig_settings

    setup = load_rig_settings(rig)
    torque, playing = load_signal(signal, setup), Playing(rate, ramp, silence)
    layout = Layout(setup)
    opened = Port(port, baud or setup.protocol.baud)
    again = partial(Port, port, baud or setup.protocol.baud)
    first = iter([opened])
    try:
        file = Appender(out, layout.header, more=append)
    except BaseException:
        opened.close()
        raise
    logger = Logger(lambda: next(first, None) or again(), layout, file)
    show = Shown(setup.protocol.format().columns)
    with asked_to_stop() as asked, keys() as key:

        def stop() -> str:
            pressed = key()
            if pressed:
                return f"emergency stop by the key {pressed!r}"
            return "ramp" if asked() else ""

        try:
            reason = play(logger, torque, setup, playing, stop, show)
        finally:
            show.end()
            logger.close()
            if not file.rows and not append:
                out.unlink(missing_ok=True)
    print(told(logger.counts))
    print(f"written to {out}")
    if reason:
        print(f"not played to its end: {reason}")
        raise typer.Exit(1)
