"""frictionid.tune: settings of a suite's identifiers, searched within the training folds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from joblib import cpu_count

from frictionid.comparison import suite as suites
from frictionid.comparison.result_folder import lock
from frictionid.comparison.search_space import Objective
from frictionid.comparison.tuning import Study, study_specs, tuning_tasks
from frictionid.comparison.tuning import tune as search
from frictionid.files import suite_path
from frictionid.outputs import check_unchanged, check_writable
from frictionid.report.console import printed, printed_html
from frictionid.report.figures.studies import progress
from frictionid.report.figures.style import drawn
from frictionid.report.sensitivity import score_table, settings_tables, trials, write_outcome
from frictionid.report.terminal import show_table


@dataclass(frozen=True, eq=False, repr=False)
class Tuned:
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

    def __repr__(self) -> str:
        return printed(self.show).rstrip("\n")

    def _repr_html_(self) -> str:
        return printed_html(self.show)

    def show(self) -> None:
        """Print scores and chosen settings."""
        for table in (score_table(self.studies, self.objective), *settings_tables(self.studies)):
            show_table(table)

    @property
    def frame(self) -> pd.DataFrame:
        """All trials, a line for each: study, number, score on the inner folds, settings."""
        return trials(self.studies)

    def plot(self) -> Any:
        """How the searches went on, as a Matplotlib figure."""
        return drawn(partial(progress, self.studies, self.objective))


def tune(
    suite: str | Path,
    *,
    data: str | Path | None = None,
    out: str | Path | None = None,
    trials: int | None = None,
    jobs: int = 0,
    resume: bool = False,
    replace: bool = False,
    trust: bool = False,
    done: Callable[[str], None] = lambda _: None,
    progress: Callable[[Path, int], AbstractContextManager[Callable[[str], None]]] | None = None,
) -> Tuned:
    """Search settings of a suite's identifiers, nested in the training folds.

    Parameters
    ----------
    suite : path of a suite file, or name of one that comes with the package
    data : path, optional
        Folder with the tables of the suite's one data set.
    out : path, optional
        Result folder; by default report/<suite>-tune.
    trials : int, optional
        Number of trials of each study, in place of the suite's.
    jobs : int
        Number of parallel trials; 0: one for each core.
    resume : bool
        Whether finished trials are kept.
    replace : bool
        Whether an earlier search of the folder may be replaced.
    trust : bool
        Whether code that the suite and its data sets name by its module may run.
    done : function, optional
        Called with each finished trial.
    progress : function, optional
        In its place: gets result folder and number of trials, gives a context of such a function.

    Raises
    ------
    InputError
        Where the suite says what cannot be searched, or the folder is not to be replaced.

    Examples
    --------
    Twenty trials of each study of one's own suite::

        tuned = frictionid.tune("suite.toml", trials=20)
        tuned.frame.sort_values("score")
    """
    path = suite_path(Path(suite))
    table = suites.load_suite(path)
    tuning = table.tune.model_copy(update={} if trials is None else {"trials": trials})
    folder = Path("report") / f"{table.name}-tune" if out is None else Path(out)
    check_writable(folder)
    tasks = tuning_tasks(table, path, None if data is None else Path(data), trust=trust)
    total = tuning.trials * len(study_specs(tasks, tuning))
    with (
        nullcontext(done) if progress is None else progress(folder, total) as report,
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
