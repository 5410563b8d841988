"""frictionid.run_suite and frictionid.tune: what a suite file says, done in its result folder."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from joblib import cpu_count

from frictionid.comparison import suite as suites
from frictionid.comparison.cross_validate import PreparedBenchmark
from frictionid.comparison.result_folder import UNFINISHED, lock, unfinished
from frictionid.comparison.results import Results, describe, load_results
from frictionid.comparison.search_space import Objective
from frictionid.comparison.suite import Suite, tasks_of
from frictionid.comparison.tasks import Task, prepare_benchmarks, run_tasks
from frictionid.comparison.tuning import Study, study_specs
from frictionid.comparison.tuning import tune as search
from frictionid.comparison.tuning_task import tuning_tasks
from frictionid.errors import InputError
from frictionid.files import suite_path
from frictionid.outputs import check_unchanged, check_writable
from frictionid.pictures import drawn
from frictionid.progress import Done, say_nothing
from frictionid.report import build
from frictionid.report.figures.studies import progress as progress_picture
from frictionid.report.sensitivity import score_table, settings_tables, trials_of, write_outcome
from frictionid.report.terminal import Shown, show_table

from .comparison import Comparison


def run_in_folder(
    tasks: Sequence[Task],
    prepared: Mapping[str, PreparedBenchmark],
    about: tuple[str, str, Any],
    folder: Path,
    *,
    jobs: int = 0,
    dask: str | None = None,
    resume: bool = False,
    replace: bool = False,
    done: Callable[[Task], None] = say_nothing,
) -> Results:
    """Results of the tasks; an earlier result of the folder stays until they are whole.

    about : name, title and settings of the comparison, as its provenance has them

    Raises
    ------
    InputError
        Where no model can be fitted, or the folder holds what is not to be replaced.
    """
    with lock(folder):
        files = [task.file for task in tasks]
        with unfinished(folder, about[0], files, resume=resume, replace=replace) as place:
            describe(place, *about, tasks, prepared)
            new = place / "tasks"
            kept = (new, folder / "tasks") if resume else ()
            run_tasks(tasks, prepared, new, jobs=jobs, dask=dask, kept=kept, done=done)
        results = load_results(folder)
        build(results, replace=replace, jobs=1 if dask else jobs or cpu_count())
    return results


# A context of what is called with each finished step.
Count = AbstractContextManager[Done]


def unheard(_: Any) -> Count:
    """A context that says nothing of the steps."""
    return nullcontext(say_nothing)


def open_suite(
    suite: str | Path, data: str | Path | None, out: str | Path | None, ending: str = ""
) -> tuple[Suite, Path, Path, Path | None]:
    """A suite of a name, its file, the folder of its results, and that of its tables or None.

    Results are for report/<suite> with an ending where no folder is given.
    """
    if not isinstance(suite, str | Path):
        raise InputError(f"a suite is a file or a name, not a {type(suite).__name__}: see compare")
    path = suite_path(Path(suite))
    table = suites.load_suite(path)
    folder = Path("report") / f"{table.name}{ending}" if out is None else Path(out)
    check_writable(folder)
    return table, path, folder, None if data is None else Path(data)


def run_suite(
    suite: str | Path,
    *,
    data: str | Path | None = None,
    out: str | Path | None = None,
    jobs: int = 0,
    dask: str | None = None,
    resume: bool = False,
    replace: bool = False,
    trust: bool = False,
    progress: Callable[[Sequence[str]], Count] = unheard,
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
    trust : bool
        Whether code that the suite and its data sets name by its module may run.
    progress : function
        Gets the names of all tasks; gives a context of what is called with each finished one.

    Raises
    ------
    InputError
        Where the suite is wrong, no model can be fitted, or the folder is not to be replaced.
    """
    table, path, folder, tables = open_suite(suite, data, out)
    tasks = tasks_of(table, path, tables, trust=trust)
    names = {t.file: f"{t.benchmark.dataset.name}: {t.name}, {t.recipe.name}" for t in tasks}
    with progress([*names.values()]) as report:
        places = (folder / UNFINISHED / "tasks", folder / "tasks") if resume else ()
        prepared = prepare_benchmarks(tasks, jobs, places)
        protocol = tasks[0].benchmark.protocol
        used = {"horizons": list(protocol.horizons), "sample_time": protocol.sample_time}
        settings = table.document() | used
        results = run_in_folder(
            tasks,
            prepared,
            (table.name, table.title, settings),
            folder,
            jobs=jobs,
            dask=dask,
            resume=resume,
            replace=replace,
            done=lambda task: report(names[task.file]),
        )
    return Comparison(results)


# --- Settings, searched -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Tuned(Shown):
    """The outcome of a search.

    Attributes
    ----------
    studies : tuple of Study, one for each model and fold
    objective : Objective, the score that was lowered
    page : Path of summary.md; a suite with the settings that were chosen stands beside it
    """

    studies: tuple[Study, ...]
    objective: Objective
    page: Path

    def show(self) -> None:
        """Print scores and chosen settings."""
        for table in (score_table(self.studies, self.objective), *settings_tables(self.studies)):
            show_table(table)

    @property
    def frame(self) -> pd.DataFrame:
        """All trials, a line for each: study, number, score on the inner folds, settings."""
        return trials_of(self.studies)

    def plot(self) -> Any:
        """How the searches went on, as a Matplotlib figure."""
        return drawn(partial(progress_picture, self.studies, self.objective))


def tune(
    suite: str | Path,
    *,
    data: str | Path | None = None,
    out: str | Path | None = None,
    jobs: int = 0,
    resume: bool = False,
    replace: bool = False,
    trust: bool = False,
    progress: Callable[[int], Count] = unheard,
) -> Tuned:
    """Search settings of a suite's identifiers, nested in the training folds.

    Parameters
    ----------
    suite : path of a suite file, or name of one that comes with the package
    data : path, optional
        Folder with the tables of the suite's one data set.
    out : path, optional
        Result folder; by default report/<suite>-tune.
    jobs : int
        Number of parallel trials; 0: one for each core.
    resume : bool
        Whether finished trials are kept.
    replace : bool
        Whether an earlier search of the folder may be replaced.
    trust : bool
        Whether code that the suite and its data sets name by its module may run.
    progress : function
        Gets the number of trials; gives a context of what is called with each finished one.

    Raises
    ------
    InputError
        Where the suite says what cannot be searched, or the folder is not to be replaced.

    Examples
    --------
    The settings that a suite of one's own searches::

        tuned = frictionid.tune("suite.toml")
        tuned.frame.sort_values("score")
    """
    table, path, folder, tables = open_suite(suite, data, out, "-tune")
    tuning, tasks = table.tune, tuning_tasks(table, path, tables, trust=trust)
    total = tuning.trials * len(study_specs(tasks, tuning))
    with (
        progress(total) as report,
        lock(folder, ["journal.log"], "tuning"),
    ):
        check_unchanged(folder, replace=replace)
        studies = search(
            tasks,
            tuning,
            folder,
            resume=resume,
            replace_trials=replace,
            jobs=jobs or cpu_count(),
            done=report,
        )
        page = write_outcome(folder, studies, tuning.objective, path, replace=replace)
    return Tuned(tuple(studies), tuning.objective, page)
