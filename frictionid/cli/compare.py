"""frictionid compare: run a suite and write its result folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Require, SuitePath, SuiteTables, Trust
from frictionid.errors import InputError


class Device(StrEnum):
    """Where networks are trained."""

    cpu = "cpu"
    cuda = "cuda"


def compare(
    suite: SuitePath,
    data: SuiteTables = None,
    out: Annotated[Path | None, typer.Option(help="Result folder [report/<suite>].")] = None,
    jobs: Annotated[
        int, typer.Option(min=0, help="Number of parallel tasks; 0: one per core.")
    ] = 0,
    dask: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Run the tasks on the cluster of a Dask scheduler."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Keep finished tasks.")] = False,
    trust: Trust = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace results of another suite, or begin anew.")
    ] = False,
    device: Annotated[
        Device | None, typer.Option(help="Where networks are trained, whatever the suite says.")
    ] = None,
    json: Json = False,
    require: Require = None,
) -> None:
    """Compare friction models on identical folds, and report which one the evidence supports."""
    from joblib import cpu_count

    from frictionid.api.suites import run_suite
    from frictionid.cli.progress import interruptible, running
    from frictionid.cli.report import check_requirements, exit_unless_met
    from frictionid.report import results_json, show

    check_requirements(require)
    if dask and jobs:
        raise InputError("--jobs is for this computer, --dask for a cluster: give one of them")

    @contextmanager
    def progress(folder: Path, steps: Sequence[str]) -> Iterator[Callable[[str], None]]:
        with (
            interruptible(f"what is done stays in {folder}: finish it with --resume"),
            running(steps, f"comparing ({suite.stem})", jobs or cpu_count()) as count,
        ):
            yield count

    results = run_suite(
        suite,
        data=data,
        out=out,
        jobs=jobs,
        dask=dask,
        resume=resume,
        replace=replace,
        device=device.value if device else None,
        trust=trust,
        progress=progress,
    ).results
    print(results_json(results)) if json else show(results)
    _say_what_stays(results.folder, results.provenance["tasks"])
    exit_unless_met(results, require)


def _say_what_stays(folder: Path, files: list[str]) -> None:
    """Name results of tasks that the suite does not have: they are neither deleted nor shown."""
    others = {path.name for path in (folder / "tasks").glob("*.json")} - set(files)
    if others:
        typer.echo(
            f"{folder / 'tasks'}: {len(others)} results of tasks that the suite does not have stay",
            err=True,
        )
