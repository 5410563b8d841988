"""frictionid align: angles and a torque log on one clock, as a recording of a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def align(
    angles: Annotated[Path, typer.Argument(help="Table of angles by the camera's clock.")],
    torque: Annotated[Path, typer.Argument(help="Log of the drive.")],
    out: Annotated[Path, typer.Option(help="Folder of the data set; a recording is added.")],
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [mechanism] and [motor].")
    ] = Path("rig.toml"),
    name: Annotated[str, typer.Option(help="Name of the recording [that of the angles].")] = "",
    replace: Annotated[bool, typer.Option("--replace", help="In place of one so called.")] = False,
    marker: Annotated[
        str, typer.Option(help="Column of both files with the state of a lamp that both see.")
    ] = "",
    offset: Annotated[
        float | None, typer.Option(help="Offset to within 0.5 s, where it is known [s].")
    ] = None,
    hold: Annotated[
        str, typer.Option(help="The logged torque between two rows: linear, or previous.")
    ] = "linear",
    json: Annotated[bool, typer.Option("--json", help="Everything, as JSON.")] = False,
) -> None:
    """Find offset and drift between two clocks from the motion itself (docs/drive.md)."""
    import json as texts
    import math

    import tomli_w

    from frictionid.acquire.align import align_files as session
    from frictionid.acquire.align.alignment_text import described, document_of
    from frictionid.acquire.align.recording_folder import recording_name
    from frictionid.errors import InputError
    from frictionid.files import write_bytes, write_text
    from frictionid.report.figures.alignment import clock_picture, command_picture

    if hold not in ("linear", "previous"):
        raise InputError(f"--hold {hold!r} is unknown; known: linear, previous")
    if offset is not None and not math.isfinite(offset):
        raise InputError(f"--offset {offset} must be a finite number of seconds")
    name = name or recording_name(angles)
    session.check_out(out, name, rig, hold, replace)
    one = session.aligned(angles, torque, rig, session.Wanted(marker, offset, hold))
    session.write(one, out, name, rig, hold)
    document = document_of(one.found, one.marker, one.drives, one.sources)
    write_text(out / f"{name}.align.toml", tomli_w.dumps(document))
    table = session.head(one, rig, hold)["mechanism"]
    pictures = {"clock": clock_picture(one, table), "command": command_picture(one)}
    for kind, content in pictures.items():
        if content is not None:
            write_bytes(out / f"{name}.{kind}.png", content)
    if json:
        print(texts.dumps(document, indent=1))
        return
    print(described(one.found, one.mechanism, one.marker, one.drives))
    for remark in one.remarks:
        print(f"caution  {remark}")
    print(f"written to {out}: {name}, {len(one.angle.time)} angles, {len(one.torque.time)} torques")
