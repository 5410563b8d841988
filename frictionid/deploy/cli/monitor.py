"""frictionid monitor: whether friction has changed since a baseline."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Only, Replace, Trust
from frictionid.cli.paths import DataFolder, present

STATUS = {"unchanged": 0, "changed": 1, "cannot_tell": 3}


def monitor(
    new: Annotated[list[Path], typer.Argument(help="Data sets with new recordings.")],
    baseline: Annotated[
        Path, typer.Option(help="Baseline of healthy recordings.", callback=present)
    ],
    rate: Annotated[float, typer.Option(help="Rate of false alarms.")] = 0.01,
    assume_normal: Annotated[
        bool,
        typer.Option("--assume-normal", help="Rate by a normal distribution of the changes."),
    ] = False,
    state: Annotated[
        Path | None, typer.Option(help="File that keeps arrived recordings and the evidence.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of a page to write.")] = None,
    only: Only = None,
    data: DataFolder = None,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Say whether friction has changed, in which joint, by how much, at a stated rate.

    Exit status: 0 unchanged, 1 changed, 3 the recordings cannot tell at that rate.
    """
    from functools import partial

    from frictionid.data.readers.dataset import load_dataset
    from frictionid.deploy.api.monitor import monitor as judged
    from frictionid.deploy.report.drift import drift_figure
    from frictionid.deploy.report.monitoring import judgement_document, write_monitoring
    from frictionid.files import json_text

    sets = [load_dataset(path, data, trust=trust) for path in new]
    found = judged(
        baseline,
        sets,
        rate=rate,
        test="normal" if assume_normal else "permutation",
        state=state,
        only=only or (),
    )
    page = None
    if out is not None:
        draw = partial(drift_figure, found.baseline, found.changes, found.arrivals)
        page = write_monitoring(
            out, found.baseline, found.judgement, found.names, found.arrivals, draw, replace=replace
        )
    if json:
        parts = (found.baseline, found.judgement, found.names, found.arrivals)
        print(json_text(judgement_document(*parts)), end="")
    else:
        print(found)
        if page is not None:
            print(f"written to {page}")
    raise typer.Exit(STATUS[found.answer])
