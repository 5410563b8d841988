"""frictionid predict: the motion that a model predicts, as a table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace, Trust
from frictionid.cli.paths import DataFolder, DatasetPath, ModelPath


def predict(
    model: ModelPath,
    dataset: DatasetPath,
    out: Annotated[Path, typer.Option(help="Table to write (CSV or Parquet).")],
    horizon: Annotated[float, typer.Option(help="How far ahead [s].")] = 1.0,
    every: Annotated[
        float | None, typer.Option(help="Time between two starts [s]; the horizon.")
    ] = None,
    whole: Annotated[
        bool, typer.Option("--whole", help="Whole recordings from their start instead.")
    ] = False,
    law: Annotated[
        list[str] | None,
        typer.Option(help="Class of a law that is not built in, module:Class; repeatable."),
    ] = None,
    data: DataFolder = None,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Write the motion that a model predicts beside the measured one, in SI units."""
    from frictionid.api.evaluate import predict as predicted
    from frictionid.comparison.registry import friction_of
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.files import json_text, write_bytes
    from frictionid.outputs import check_outputs

    check_outputs([out], [model, *dataset_files(dataset, data)], replace=replace)
    friction = friction_of(model, law or ())
    table = predicted(
        friction, load_dataset(dataset, data, trust=trust), horizon, every, whole=whole
    )
    if out.suffix == ".parquet":
        write_bytes(out, table.to_parquet(index=False))
    else:
        write_bytes(out, table.to_csv(index=False, float_format="%.9g").encode())
    starts = len(table[["recording", "start_s"]].drop_duplicates())
    if json:
        print(json_text({"predictions": starts, "lines": len(table), "written": [out]}), end="")
        return
    print(f"{starts} predictions, {len(table)} lines\nwritten to {out}")
