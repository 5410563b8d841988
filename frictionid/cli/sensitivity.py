"""frictionid sensitivity: what a wrong parameter, sensor or circumstance does to friction."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace, Trust
from frictionid.cli.paths import SuitePath


def sensitivity(
    suite: SuitePath,
    data: Annotated[
        Path | None, typer.Option(help="Folder with the tables of the suite's one data set.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Result folder [report/<suite>-sensitivity].")
    ] = None,
    identifier: Annotated[
        list[str] | None,
        typer.Option(help="Identifier of the suite; repeatable [its first parametric law]."),
    ] = None,
    recipe: Annotated[
        list[str] | None, typer.Option(help="Recipe of the suite; repeatable [all of them].")
    ] = None,
    jobs: Annotated[int, typer.Option(min=0, help="Number of parallel fits; 0: one per core.")] = 0,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Fit with one thing wrong at a time: parameters, delay, gain, tilt, noise, rate, recordings.

    Each variation is fitted and judged on held-out recordings; recipes that shoot come with base
    parameters held and free. Fits that are in the folder are kept.
    """
    from frictionid.api.sensitivity import sensitivity_of_suite
    from frictionid.cli.progress import counted
    from frictionid.files import json_text
    from frictionid.report.figures.sensitivity import summarised
    from frictionid.report.sensitivity import sensitivity_table, studies
    from frictionid.report.terminal.terminal import show_table

    def bar(total: int) -> AbstractContextManager[Callable[[str], None]]:
        return counted(total, "sensitivity")

    try:
        frame, page = sensitivity_of_suite(
            suite,
            data=data,
            out=out,
            identifiers=identifier,
            recipes=recipe,
            jobs=jobs,
            replace=replace,
            trust=trust,
            progress=bar,
        )
    except KeyboardInterrupt:
        typer.echo(
            "frictionid: interrupted; finished fits are kept: run the same command again", err=True
        )
        raise typer.Exit(130) from None
    if json:
        rows = summarised(frame).to_dict(orient="records")
        print(json_text({"fits": rows, "written": [page]}), end="")
        return
    for _, part in studies(frame):
        show_table(sensitivity_table(part))
    print(f"written to {page.resolve()}")
