"""frictionid tune: search settings of identifiers, nested in the training folds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace, Trust
from frictionid.cli.paths import SuitePath


def tune(
    suite: SuitePath,
    data: Annotated[
        Path | None, typer.Option(help="Folder with the tables of the suite's one data set.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Result folder [report/<suite>-tune].")] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, help="Number of trials of each study [the suite's].")
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=0, help="Number of parallel trials; 0: one per core.")
    ] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Keep finished trials.")] = False,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Search settings of a suite's identifiers, and write those chosen as a suite."""
    from frictionid.api.tune import open_tuning
    from frictionid.cli.progress import counted
    from frictionid.report.tuning import outcome_json

    opened = open_tuning(suite, data=data, out=out, trials=trials, trust=trust)
    try:
        with counted(opened.total, f"tuning ({opened.name})") as done:
            tuned = opened.run(jobs=jobs, resume=resume, replace=replace, done=done)
    except KeyboardInterrupt:
        typer.echo(
            f"frictionid: interrupted; what is done stays in {opened.folder}: finish it with "
            "--resume",
            err=True,
        )
        raise typer.Exit(130) from None
    if json:
        print(outcome_json(tuned.studies, tuned.page), end="")
        return
    tuned.show()
    print(f"written to {tuned.page.resolve()}")
