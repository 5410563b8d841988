"""frictionid log: the lines of a motor drive, appended to a file."""

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
