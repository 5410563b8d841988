"""frictionid compare: run a suite and write its result folder."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Trust
from frictionid.cli.paths import SuitePath


class Device(StrEnum):
    """Where networks are trained."""

    cpu = "cpu"
    cuda = "cuda"


def compare(
    suite: SuitePath,
    data: Annotated[
        Path | None, typer.Option(help="Folder with the tables of the suite's one data set.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Result folder [report/<suite>].")] = None,
    jobs: Annotated[
        int, typer.Option(min=0, help="Number of parallel tasks; 0: one per core.")
    ] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Keep finished tasks.")] = False,
    trust: Trust = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace results of another suite, or begin anew.")
    ] = False,
    device: Annotated[
        Device | None, typer.Option(help="Where networks are trained, whatever the suite says.")
    ] = None,
    json: Json = False,
) -> None:
    """Compare friction models on identical folds, and report which one the evidence supports."""
    from joblib import cpu_count

    from frictionid.cli.progress import running
    from frictionid.comparison.registry import LAWS
    from frictionid.comparison.result_folder import lock, unfinished
    from frictionid.comparison.results import describe, load_results
    from frictionid.comparison.suite import load_suite
    from frictionid.comparison.suite_tasks import tasks_of
    from frictionid.comparison.tasks import Task, prepare_benchmarks, run_tasks
    from frictionid.outputs import check_writable
    from frictionid.report import build, results_json, show

    table = load_suite(suite)
    folder = out or Path("report") / table.name
    check_writable(folder)
    try:
        tasks = tasks_of(table, suite, data, device.value if device else None, trust=trust)
        prepared_benchmarks = prepare_benchmarks(tasks)
        words = {t.file: f"{t.benchmark.dataset.name}: {t.name}, {t.recipe.name}" for t in tasks}
        title = f"comparing ({table.name})"
        with lock(folder), running([*words.values()], title, jobs or cpu_count()) as count:

            def done(task: Task) -> None:
                count(words[task.file])

            settings = table.document() | ({"device": device.value} if device else {})
            files = [task.file for task in tasks]
            with unfinished(folder, table.name, files, resume=resume, replace=replace) as place:
                describe(place, table.name, table.title, settings, tasks, prepared_benchmarks)
                new = place / "tasks"
                kept = (new, folder / "tasks") if resume else ()
                run_tasks(tasks, prepared_benchmarks, new, LAWS, jobs=jobs, kept=kept, done=done)
            results = load_results(folder)
            build(results, replace=replace)
    except KeyboardInterrupt:
        typer.echo(
            f"frictionid: interrupted; what is done stays in {folder}: finish it with --resume",
            err=True,
        )
        raise typer.Exit(130) from None
    print(results_json(results)) if json else show(results)
    _say_what_stays(folder, files)


def _say_what_stays(folder: Path, files: list[str]) -> None:
    """Name results of tasks that the suite does not have: they are neither deleted nor shown."""
    others = {path.name for path in (folder / "tasks").glob("*.json")} - set(files)
    if others:
        typer.echo(
            f"{folder / 'tasks'}: {len(others)} results of tasks that the suite does not have stay",
            err=True,
        )
