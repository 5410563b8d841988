"""Tasks of a comparison, run into a result folder with its report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from joblib import cpu_count

from frictionid.comparison.cross_validate import PreparedBenchmark
from frictionid.comparison.registry import LAWS
from frictionid.comparison.result_folder import lock, unfinished
from frictionid.comparison.results import Results, describe, load_results
from frictionid.comparison.tasks import Task, run_tasks
from frictionid.report import build


class About(NamedTuple):
    """Name, title and settings of a comparison, as its provenance has them."""

    name: str
    title: str
    settings: Any


def run_in_folder(
    tasks: Sequence[Task],
    prepared: Mapping[str, PreparedBenchmark],
    about: About,
    folder: Path,
    *,
    jobs: int = 0,
    dask: str | None = None,
    resume: bool = False,
    replace: bool = False,
    done: Callable[[Task], None] = lambda _: None,
) -> Results:
    """Results of the tasks; an earlier result of the folder stays until they are whole.

    Raises
    ------
    InputError
        Where a task fails, or the folder holds what is not to be replaced.
    """
    with lock(folder):
        files = [task.file for task in tasks]
        with unfinished(folder, about.name, files, resume=resume, replace=replace) as place:
            describe(place, *about, tasks, prepared)
            new = place / "tasks"
            kept = (new, folder / "tasks") if resume else ()
            run_tasks(tasks, prepared, new, LAWS, jobs=jobs, dask=dask, kept=kept, done=done)
        results = load_results(folder)
        build(results, replace=replace, jobs=1 if dask else jobs or cpu_count())
    return results
