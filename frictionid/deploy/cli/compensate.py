"""frictionid compensate: a fitted friction as a feed-forward of drives and controllers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace
from frictionid.cli.paths import ModelPath


def compensate(
    model: ModelPath,
    out: Annotated[Path, typer.Option(help="File to write.")],
    to: Annotated[
        str, typer.Option(help="csv (a table over velocity), or a format of export: c, st ...")
    ] = "csv",
    gain: Annotated[float, typer.Option(help="Share that is compensated, at most 1.")] = 0.9,
    smooth: Annotated[
        float, typer.Option(help="Reference speed [rad/s] over which the torque changes sides.")
    ] = 0.05,
    limit: Annotated[float | None, typer.Option(help="Largest torque [N m].")] = None,
    speed: Annotated[
        list[float] | None,
        typer.Option(
            help="Greatest measured speed [rad/s], the table's last; once, or for each joint."
        ),
    ] = None,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Write the torque that cancels friction along a reference, over the reference's velocity."""
    from dataclasses import replace as renewed

    from frictionid.comparison.registry import friction_of
    from frictionid.deploy.api.export import export
    from frictionid.deploy.export.formats import ExportSettings
    from frictionid.deploy.use.compensation import Compensation, compensating, compensation_table
    from frictionid.errors import InputError
    from frictionid.evaluation import known_speeds
    from frictionid.files import json_text, write_bytes
    from frictionid.outputs import check_outputs

    friction = friction_of(model)
    settings = Compensation(gain=gain, smooth=smooth, torque_limit=limit)
    known = tuple(speed or known_speeds(friction))
    known = known * friction.n if len(known) == 1 else known
    source = {**friction.provenance, **({"speeds": known} if known else {})}
    friction = renewed(friction, provenance=source)
    if to != "csv":
        own = compensating(friction, settings)
        names = ExportSettings(name="compensation")
        written = export(own, to, out, settings=names, replace=replace).paths
    else:
        if not known:
            raise InputError(f"{model}: the measured speeds are not known; give --speed")
        check_outputs([out], [model], replace=replace)
        table = compensation_table(friction, settings, known)
        write_bytes(out, table.to_csv(index=False, float_format="%.9g").encode())
        written = (out,)
    if json:
        print(json_text({"written": written}), end="")
        return
    for path in written:
        print(f"written to {path}")
