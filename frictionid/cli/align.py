"""frictionid align: put angles and a torque log on one clock, as a recording of a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.paths import present


def align(
    angles: Annotated[
        Path, typer.Argument(help="Table of angles by the camera's clock.", callback=present)
    ],
    torque: Annotated[Path, typer.Argument(help="Log of the drive.", callback=present)],
    out: Annotated[Path, typer.Option(help="Folder of the data set; a recording is added.")],
    rig: Annotated[
        Path, typer.Option(help="Settings with the tables [mechanism] and [motor].")
    ] = Path("rig.toml"),
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
    json: Annotated[bool, typer.Option("--json", help="Print all numbers as JSON.")] = False,
) -> None:
    """Estimate offset and drift between two clocks from the motion itself (docs/drive.md)."""
    import json as texts
    import math

    import tomli_w

    from frictionid.acquire.align.align_files import AlignmentOptions, align_files, load_rig
    from frictionid.acquire.align.alignment_text import alignment_document, alignment_text
    from frictionid.acquire.align.recording_folder import (
        add_recording,
        check_place,
        recording_name,
    )
    from frictionid.errors import InputError
    from frictionid.files import write_bytes, write_text
    from frictionid.report.figures.alignment import alignment_pictures

    if hold not in ("linear", "previous"):
        raise InputError(f"--hold {hold!r} is unknown; known: linear, previous")
    if offset is not None and not math.isfinite(offset):
        raise InputError(f"--offset {offset} must be a finite number of seconds")
    name = name or recording_name(angles)
    settings = load_rig(rig)
    head = settings.head(hold)
    check_place(out, name, head, replace)
    one = align_files(angles, torque, settings, AlignmentOptions(marker, offset, hold))
    pictures = alignment_pictures(one)
    add_recording(out, name, head, one.angle, one.torque)
    document = alignment_document(one.alignment, one.marker, one.responses, one.sources)
    write_text(out / f"{name}.align.toml", tomli_w.dumps(document))
    for kind, picture in pictures.items():
        write_bytes(out / f"{name}.{kind}.png", picture)
    if json:
        print(texts.dumps(document, indent=1))
        return
    print(alignment_text(one.alignment, one.mechanism, one.marker, one.responses))
    for warning in one.warnings:
        print(f"warning  {warning}")
    print(f"written to {out}: {name}, {len(one.angle.time)} angles, {len(one.torque.time)} torques")
