"""frictionid.run_suite: the comparison of a suite file, written to its result folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

from joblib import cpu_count

from frictionid.api.comparison import Comparison
from frictionid.comparison import suite as suites
from frictionid.comparison.cross_validate import PreparedBenchmark
from frictionid.comparison.registry import LAWS
from frictionid.comparison.result_folder import UNFINISHED, lock, unfinished
from frictionid.comparison.results import Results, describe, load_results
from frictionid.comparison.suite_tasks import tasks_of
from frictionid.comparison.tasks import Task, prepare_benchmarks, run_tasks
from frictionid.files import suite_path
from frictionid.outputs import check_writable
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


# What shows how far a comparison is: gets its folder and the names of its steps, and gives what is
# called with each that is finished.
Progress = Callable[[Path, Sequence[str]], AbstractContextManager[Callable[[str], None]]]


def run_suite(
    suite: str | Path,
    *,
    data: str | Path | None = None,
    out: str | Path | None = None,
    jobs: int = 0,
    dask: str | None = None,
    resume: bool = False,
    replace: bool = False,
    device: str | None = None,
    trust: bool = False,
    done: Callable[[str], None] = lambda _: None,
    progress: Progress | None = None,
) -> Comparison:
    """Run a suite, and write its result folder: tables, pictures, models, and a page.

    Parameters
    ----------
    suite : str or Path
        Suite file, or the name of one that comes with the package.
    data : str or Path, optional
        Folder with the tables of its one data set.
    out : str or Path, optional
        Result folder; report/<suite>.
    jobs : int
        Number of parallel tasks; 0: one for each core.
    dask : str, optional
        Address of the scheduler of a Dask cluster, whose workers run the tasks.
    resume : bool
        Keep finished tasks.
    replace : bool
        Replace results of another suite, or begin anew.
    device : "cpu" or "cuda", optional
        Where networks are trained, whatever the suite says.
    trust : bool
        Whether code that the suite and its data sets name by its module may run.
    done : function
        Called with the name of each task that is finished.
    progress : function, optional
        In its place: gets result folder and names of all tasks, gives a context of such a function.

    Raises
    ------
    InputError
        Where the suite is wrong, a task fails, or the folder holds what is not to be replaced.
    """
    path = suite_path(Path(suite))
    table = suites.load_suite(path)
    folder = Path("report") / table.name if out is None else Path(out)
    check_writable(folder)
    tasks = tasks_of(table, path, None if data is None else Path(data), device, trust=trust)
    names = {t.file: f"{t.benchmark.dataset.name}: {t.name}, {t.recipe.name}" for t in tasks}
    with nullcontext(done) if progress is None else progress(folder, [*names.values()]) as report:
        places = (folder / UNFINISHED / "tasks", folder / "tasks") if resume else ()
        prepared = prepare_benchmarks(tasks, jobs, places)
        protocol = tasks[0].benchmark.protocol
        used = {"horizons": list(protocol.horizons), "sample_time": protocol.sample_time}
        settings = table.document() | used | ({"device": device} if device else {})
        results = run_in_folder(
            tasks,
            prepared,
            About(table.name, table.title, settings),
            folder,
            jobs=jobs,
            dask=dask,
            resume=resume,
            replace=replace,
            done=lambda task: report(names[task.file]),
        )
    return Comparison(results)
