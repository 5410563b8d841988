"""frictionid check: errors in recordings and what they identify, before any fit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Replace, Trust
from frictionid.cli.paths import DatasetPath


def check(
    dataset: DatasetPath,
    data: Annotated[Path | None, typer.Option(help="Folder with the tables.")] = None,
    published: Annotated[
        Path | None, typer.Option(help="Model file to compare with the data.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print all numbers as JSON.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for pictures.")] = None,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Report errors in recordings, what the recordings identify, and what to record next.

    Questions are answered by yes, NO, or not tested and why; yes means that the test could have
    failed. Of each motor's torque it says whether it is measured, commanded or modelled.

    The exit status is 0 where the data are good, 1 doubtful, 2 unusable as they stand.
    """
    from frictionid.api.check import check as check_data
    from frictionid.check import LEVELS
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.report.diagnostics import show_verdict

    if out is not None:
        from frictionid.outputs import check_outputs
        from frictionid.report.figures.diagnostics import picture_paths

        check_outputs(
            picture_paths(out), (*dataset_files(dataset, data), published), replace=replace
        )
    verdict = check_data(load_dataset(dataset, data, trust=trust), published)
    if json:
        print(verdict.json())
    else:
        show_verdict(verdict.details)
    if out:
        from frictionid.report.figures.diagnostics import write_pictures

        for path in write_pictures(verdict.details, out):
            typer.echo(f"written to {path}", err=True)
    raise typer.Exit(LEVELS.index(verdict.level))
