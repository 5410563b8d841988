"""frictionid baseline: how the friction of a healthy machine scatters between recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Only, Replace, Trust
from frictionid.cli.paths import DataFolder, DatasetPath, present


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
