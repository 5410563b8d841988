"""frictionid.run_suite: the comparison of a suite file, written to its result folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from joblib import cpu_count

from frictionid.api.comparison import Comparison
from frictionid.comparison import suite as suites
from frictionid.comparison.cross_validate import PreparedBenchmark
from frictionid.comparison.registry import LAWS
from frictionid.comparison.result_folder import UNFINISHED, lock, unfinished
from frictionid.comparison.results import Results, describe, load_results
from frictionid.comparison.suite import Suite
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


@dataclass(frozen=True, eq=False)
class OpenSuite:
    """A suite, ready to run; its data are read when its tasks are first asked for.

    Attributes
    ----------
    suite : Suite
    path : Path, of its file
    folder : Path, of its results
    data : Path or None
        Folder with the tables of its one data set.
    device : str or None
        Where networks are trained, whatever the suite says.
    trust : bool
        Whether code that the suite and its data sets name by its module may run.
    """

    suite: Suite
    path: Path
    folder: Path
    data: Path | None = None
    device: str | None = None
    trust: bool = False

    @cached_property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks, in the order in which tables show them."""
        tasks = tasks_of(self.suite, self.path, self.data, self.device, trust=self.trust)
        return tuple(tasks)

    @property
    def steps(self) -> dict[str, str]:
        """Names of the tasks for people, by those of their files."""
        return {
            t.file: f"{t.benchmark.dataset.name}: {t.name}, {t.recipe.name}" for t in self.tasks
        }

    def run(
        self,
        *,
        jobs: int = 0,
        dask: str | None = None,
        resume: bool = False,
        replace: bool = False,
        done: Callable[[str], None] = lambda _: None,
    ) -> Comparison:
        """Run the tasks and write the report; `done` is called with each finished step.

        Raises
        ------
        InputError
            Where a task fails, or the folder holds what is not to be replaced.
        """
        suite, steps = self.suite, self.steps
        places = (self.folder / UNFINISHED / "tasks", self.folder / "tasks") if resume else ()
        prepared = prepare_benchmarks(self.tasks, jobs, places)
        protocol = self.tasks[0].benchmark.protocol
        used = {"horizons": list(protocol.horizons), "sample_time": protocol.sample_time}
        settings = suite.document() | used | ({"device": self.device} if self.device else {})

        def report(task: Task) -> None:
            done(steps[task.file])

        about = About(suite.name, suite.title, settings)
        results = run_in_folder(
            self.tasks,
            prepared,
            about,
            self.folder,
            jobs=jobs,
            dask=dask,
            resume=resume,
            replace=replace,
            done=report,
        )
        return Comparison(results)


def open_suite(
    suite: str | Path,
    *,
    data: str | Path | None = None,
    out: str | Path | None = None,
    device: str | None = None,
    trust: bool = False,
) -> OpenSuite:
    """The suite of a file or name with its tasks; parameters as in `run_suite`.

    Raises
    ------
    InputError
        For unknown names and settings, or a folder that cannot be written.
    """
    path = suite_path(Path(suite))
    table = suites.load_suite(path)
    folder = Path("report") / table.name if out is None else Path(out)
    check_writable(folder)
    tables = None if data is None else Path(data)
    return OpenSuite(table, path, folder, tables, device, trust)


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

    Raises
    ------
    InputError
        Where the suite is wrong, a task fails, or the folder holds what is not to be replaced.
    """
    opened = open_suite(suite, data=data, out=out, device=device, trust=trust)
    return opened.run(jobs=jobs, dask=dask, resume=resume, replace=replace, done=done)
