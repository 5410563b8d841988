"""frictionid align: put angles and a torque log on one clock, as a recording of a data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, present


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
    json: Json = False,
) -> None:
    """Estimate offset and drift between two clocks from the motion itself (docs/drive.md)."""
    import json as texts

    from frictionid.rig.api.align import align as aligned

    found = aligned(
        *(angles, torque, rig),
        name=name,
        marker=marker,
        offset=offset,
        hold=hold,
        folder=out,
        replace=replace,
    )
    if json:
        print(texts.dumps(found.document, indent=1))
        return
    print(found)
    one = found.found
    print(
        f"written to {out}: {found.name}, {len(one.angle.time)} angles, "
        f"{len(one.torque.time)} torques"
    )
