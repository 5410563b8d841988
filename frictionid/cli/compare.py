"""frictionid compare: run a suite and write its result folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def compare(
    suite: Annotated[Path, typer.Argument(help="Suite file, e.g. comparisons/acrobot.toml.")],
    data: Annotated[
        Path | None, typer.Option(help="Folder with the tables of the suite's one data set.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Result folder [report/<suite>].")] = None,
    jobs: Annotated[int, typer.Option(min=0, help="Tasks side by side; 0: one per core.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Keep what is already done.")] = False,
) -> None:
    """Compare friction models on identical folds, and report which one the evidence supports."""
    import os

    from frictionid.cli.progress import counted
    from frictionid.report import build, show
    from frictionid.results import describe
    from frictionid.suite import LAWS, load_suite, tasks_of
    from frictionid.tasks import lock, run_tasks

    table = load_suite(suite)
    tasks = tasks_of(table, suite.parent, data)
    folder = out or Path("report") / table.name
    with lock(folder):
        describe(folder, table.name, table.title, table.model_dump(mode="json"), tasks)
        with counted(len(tasks), f"comparing ({table.name})", str(folder)) as done:
            run_tasks(
                tasks,
                folder / "tasks",
                LAWS,
                jobs=jobs or os.cpu_count() or 1,
                resume=resume,
                done=lambda task: done(f"{task.contest.dataset.name}: {task.name}, {task.recipe.name}"),
            )
        build(folder)
    show(folder)
