"""frictionid pool: fitted models of several specimens as one, with the spread between them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Equal, Json, Replace
from frictionid.cli.paths import ModelPaths


def pool(
    models: ModelPaths,
    out: Annotated[Path, typer.Option(help="Model file to write: the means, and the ranges.")],
    ranges: Annotated[
        Path | None, typer.Option(help="Ranges of another specimen to write (JSON), with units.")
    ] = None,
    equal: Equal = None,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Pool fitted models of several specimens: means, spread, and ranges of another specimen."""
    from frictionid.api.pool import pool as pool_models
    from frictionid.files import json_text, write_json
    from frictionid.friction.model_files import model_paths
    from frictionid.outputs import check_outputs
    from frictionid.report.pooling import show_pooled

    read = [path for model in models for path in model_paths(model)]
    groups = [[name.strip() for name in group.split(",")] for group in equal or []]
    check_outputs([*model_paths(out), ranges], read, replace=replace)
    made = pool_models(models, equal=groups)
    made.save(out)
    if ranges is not None:
        write_json(ranges, {"format": "frictionid ranges 1", "ranges": made.ranges()})
    document = made.friction.provenance["pooled"]
    if json:
        print(json_text(document), end="")
        return
    show_pooled(document)
    for path in (out, ranges):
        if path is not None:
            print(f"written to {path}")
