"""frictionid quick: a first verdict and a picture in about a minute."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace, Trust
from frictionid.cli.paths import DataFolder, DatasetPath


def quick(
    dataset: DatasetPath,
    figure: Annotated[
        Path | None, typer.Option(help="Picture to write (PNG) [quick-<name>.png].")
    ] = None,
    data: DataFolder = None,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Check a data set, compare three friction laws on held-out motion, and say which one holds.

    The exit status is 2 where the data are unusable, else 0.
    """
    from frictionid.api.quick import quick as first_verdict
    from frictionid.cli.progress import running
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.files import file_names, write_bytes
    from frictionid.outputs import check_outputs
    from frictionid.quickstart.quick import STEPS
    from frictionid.quickstart.quick_picture import quick_picture
    from frictionid.quickstart.quick_text import quick_json, show_quick

    loaded = load_dataset(dataset, data, trust=trust)
    figure = figure or Path(f"quick-{file_names([loaded.name])[loaded.name]}.png")
    check_outputs([figure], dataset_files(dataset, data), replace=replace)
    with running(STEPS, f"first verdict ({loaded.name})") as done:
        found = first_verdict(loaded, done)
    print(quick_json(found)) if json else show_quick(found)
    if found.chosen is None:
        raise typer.Exit(2)
    write_bytes(figure, quick_picture(found))
    typer.echo(f"written to {figure}", err=True)
