"""frictionid log: the lines of a motor drive, appended to a file that no crash can take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def log(
    port: Annotated[str, typer.Option(help="Serial port, e.g. /dev/ttyUSB0.")],
    out: Annotated[Path, typer.Option(help="Log to write (CSV).")],
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [motor] and [protocol].")
    ] = Path("rig.toml"),
    baud: Annotated[int | None, typer.Option(min=1, help="In place of [protocol] baud.")] = None,
    append: Annotated[bool, typer.Option("--append", help="Go on with an existing log.")] = False,
    seconds: Annotated[
        float | None, typer.Option(min=0, help="End after so long [Ctrl-C ends it].")
    ] = None,
    patience: Annotated[
        float | None, typer.Option(min=0, help="End when nothing came for so many seconds.")
    ] = None,
) -> None:
    """Log what a motor drive reports: its clock, command and torque (docs/drive.md)."""
    from functools import partial

    from frictionid.acquire.log import Logger
    from frictionid.acquire.logfile import Appender, Layout
    from frictionid.acquire.monitor import Shown, asked_to_stop, keep_logging, told
    from frictionid.acquire.port import Port
    from frictionid.acquire.rig_settings import load_rig_settings

    setup = load_rig_settings(rig)
    layout = Layout(setup)
    opened = Port(port, baud or setup.protocol.baud)  # before a file is made
    first = iter([opened])
    again = partial(Port, port, baud or setup.protocol.baud)
    try:
        file = Appender(out, layout.header, more=append)
    except BaseException:
        opened.close()
        raise
    logger = Logger(lambda: next(first, None) or again(), layout, file)
    show = Shown(setup.protocol.format().columns)
    with asked_to_stop() as stop:
        try:
            keep_logging(logger, stop, show, seconds, patience)
        finally:
            show.end()
            logger.close()
            if not file.rows and not append:
                out.unlink(missing_ok=True)
    print(f"{told(logger.counts)}")
    print(f"written to {out}")
