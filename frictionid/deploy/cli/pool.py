"""frictionid pool: fitted models of several specimens as one, with the spread between them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Equal, Json, ModelPaths, Replace


def pool(
    models: ModelPaths,
    out: Annotated[Path, typer.Option(help="Model file to write: the means, and the ranges.")],
    ranges: Annotated[
        Path | None, typer.Option(help="Ranges of another specimen to write (JSON), with units.")
    ] = None,
    equal: Equal = None,
    over: Annotated[
        str | None,
        typer.Option(
            help="A covariate with its value for each model, e.g. temperature=20,30,40: parameters "
            "as lines over it."
        ),
    ] = None,
    at: Annotated[
        float | None, typer.Option(help="Value of the covariate to write; the middle.")
    ] = None,
    json: Json = False,
    replace: Replace = False,
) -> None:
    """Pool fitted models of several specimens: means, spread, and ranges of another specimen."""
    from frictionid.deploy.api.pool import pool as pool_models
    from frictionid.deploy.api.pool import show_pooled
    from frictionid.errors import InputError
    from frictionid.files import json_text, write_json
    from frictionid.friction.model_files import model_paths
    from frictionid.outputs import check_outputs

    read = [path for model in models for path in model_paths(model)]
    groups = [[name.strip() for name in group.split(",")] for group in equal or []]
    check_outputs([*model_paths(out), ranges], read, replace=replace)
    if over is not None:
        if groups or ranges is not None:
            raise InputError("pool: --over goes with neither --equal nor --ranges: leave them out")
        _over(models, over, at, out, json=json)
        return
    if at is not None:
        raise InputError("pool: --at needs --over, which names the covariate")
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


def _over(models: list[Path], over: str, at: float | None, out: Path, *, json: bool) -> None:
    """Print the parameters over a covariate, and write the friction at one value of it."""
    from frictionid.comparison.registry import LAWS
    from frictionid.deploy.api.covariate import over_covariate
    from frictionid.errors import InputError
    from frictionid.friction.model_files import save_model

    name, _, numbers = over.partition("=")
    try:
        values = [float(value) for value in numbers.split(",")]
    except ValueError:
        raise InputError(f"--over {over}: write it as temperature=20,30,40") from None
    made = over_covariate({str(model): model for model in models}, name, values)
    value = sum(made.span) / 2 if at is None else at
    save_model(made.at(value), out, LAWS)
    print(made.frame.to_json(orient="records") if json else made)
    if not json:
        print(f"written to {out}: friction at {name} = {value:g}")
