"""frictionid baseline and frictionid monitor: whether friction has changed since a baseline."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import DataFolder, DatasetPath, Json, Only, Replace, Trust, present

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


def baseline(
    dataset: DatasetPath,
    out: Annotated[Path, typer.Option(help="Baseline to write (JSON).")],
    law: Annotated[
        str, typer.Option(help="Identifier of the friction that changes are measured against.")
    ] = "stribeck",
    model: Annotated[
        Path | None, typer.Option(help="Model file in place of that fit.", callback=present)
    ] = None,
    only: Only = None,
    data: DataFolder = None,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Record the friction of a healthy machine, for `frictionid monitor`."""
    from frictionid.cli.progress import heard
    from frictionid.data.readers.dataset import dataset_files, load_dataset
    from frictionid.deploy.api.monitor import baseline as make
    from frictionid.deploy.monitor.two_samples import least_rate
    from frictionid.files import json_text
    from frictionid.outputs import check_outputs

    check_outputs([out], [model, *dataset_files(dataset, data)], replace=replace)
    loaded = load_dataset(dataset, data, trust=trust)
    with heard(f"baseline ({loaded.name})"):
        made = make(loaded, out, law=law, model=model, only=only or ())
    count = len(made.names)
    rates = {k: least_rate(count, k) for k in (1, 2, 5)}
    if json:
        print(json_text({"recordings": made.names, "least_rate": rates, "written": [out]}), end="")
        return
    print(f"{count} healthy recordings of {', '.join(made.joints)}")
    for k, rate in rates.items():
        print(f"least rate of false alarms of {k} new recording{'s' * (k > 1)}: {rate:.2g}")
    print(f"written to {out}")
