"""frictionid.sensitivity: what a wrong parameter, sensor or circumstance does to friction."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from frictionid.comparison.cross_validate import Benchmark
from frictionid.comparison.result_folder import lock
from frictionid.comparison.results import provenance_of
from frictionid.comparison.sensitivity_study import cases_of, run_cases, sensitivity_cases
from frictionid.comparison.tasks import Task
from frictionid.comparison.training_set import Method, check_method
from frictionid.comparison.variations import SensitivitySettings
from frictionid.config import checked
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split, make_folds
from frictionid.outputs import check_unchanged
from frictionid.pictures import drawn
from frictionid.progress import Done, say_nothing
from frictionid.report.figures.studies import over_amounts, summarised, tornado
from frictionid.report.sensitivity import sensitivity_table, write_sensitivity
from frictionid.report.terminal import Shown, show_table

from .fit import method_of
from .models import DatasetLike, LawLike, dataset_of, identifier_of
from .suites import Count, open_suite, unheard

CASES = "fits"  # folder of the results of single fits


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Shown):
    """A sensitivity study of one data set and law.

    Attributes
    ----------
    frame : DataFrame
        A row for each recipe and variation: `loss` [rad/s], `rollout` [rad], and for each joint J
        `curve_change_J` to the nominal fit and `curve_error_J` to the truth, relative.
    """

    frame: pd.DataFrame

    def show(self) -> None:
        show_table(sensitivity_table(summarised(self.frame)))

    def plot(self, kind: str = "tornado") -> Any:
        """Bars of what matters most ("tornado"), or lines over the "amounts", as a figure.

        Raises
        ------
        InputError
            For another kind, or where no cause has two amounts.
        """
        kinds = {"tornado": tornado, "amounts": over_amounts}
        if kind not in kinds:
            raise InputError(f"kind = {kind!r} is unknown; known are {', '.join(kinds)}")
        frame = summarised(self.frame)
        if kind == "amounts" and over_amounts(frame) is None:
            raise InputError("no cause has two amounts: give levels of several values")
        return drawn(partial(kinds[kind], frame))


def sensitivity(
    data: DatasetLike,
    law: LawLike,
    *,
    method: str | Method = "one_step",
    recipe: str = "integral",
    free: str | Sequence[str] | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
    jobs: int = 0,
    done: Done = say_nothing,
) -> Sensitivity:
    """Fit friction with one thing wrong at a time, and say what that changes.

    Mechanical parameters, gain and delay of the torque, tilt, noise, sampling rate and number of
    recordings are varied; each fit is judged on held-out recordings.

    Parameters
    ----------
    data, law, method, recipe, free : as of `frictionid.fit`
        By shooting, base parameters are held and free in turn.
    settings : mapping, optional
        The keys of `SensitivitySettings`, such as {"levels": [-0.05, 0.05], "noise": []}.
    seed : int
    jobs : int
        Number of parallel fits; 0: one for each core.
    done : function
        Called with the name of each fit that is finished.

    Examples
    --------
    What a mass that is 10 % wrong does to a rig of one's own::

        study = frictionid.sensitivity("my_rig", "stribeck", settings={"parameters": ["mass"]})
        study.plot()
    """
    chosen = checked(SensitivitySettings, dict(settings or {}), "sensitivity")
    dataset, identifier = dataset_of(data), identifier_of(law)
    fitting = method_of(method, recipe=recipe, free=free)
    check_method(fitting, identifier)
    protocol = Protocol(horizons=(chosen.horizon,))
    benchmark = Benchmark(dataset, make_folds(dataset.recordings, Split()), protocol)
    name = law if isinstance(law, str) else type(identifier).__name__
    task = Task(benchmark, name, identifier, fitting, seed)
    return Sensitivity(run_cases(cases_of([task], chosen), jobs=jobs, done=done))


def sensitivity_of_suite(
    suite: str | Path,
    *,
    data: str | Path | None = None,
    out: str | Path | None = None,
    identifiers: Sequence[str] | None = None,
    recipes: Sequence[str] | None = None,
    jobs: int = 0,
    replace: bool = False,
    trust: bool = False,
    progress: Callable[[int], Count] = unheard,
) -> tuple[pd.DataFrame, Path]:
    """Frame of a suite's sensitivity study, and the page that was written.

    What a suite says under [sensitivity] is varied. Fits that are in the folder are kept, so that
    an interrupted study is finished by the same call.

    Parameters
    ----------
    suite, data, jobs, replace, trust : as of `frictionid.run_suite`
    out : str or Path, optional
        Result folder; report/<suite>-sensitivity.
    identifiers, recipes : list of str, optional
        In place of those that the suite names.
    progress : function
        Gets the number of fits; gives a context of what is called with each finished one.

    Raises
    ------
    InputError
        Where the suite is wrong, a fit fails, or the folder holds what is not to be replaced.
    """
    table, path, folder, tables = open_suite(suite, data, out, "-sensitivity")
    named = {"identifiers": identifiers, "recipes": recipes}
    update = {key: list(values) for key, values in named.items() if values}
    settings = table.sensitivity.model_copy(update=update)
    table = table.model_copy(update={"sensitivity": settings})
    cases = sensitivity_cases(table, path, tables, trust=trust)
    with lock(folder, ["provenance.json", CASES], "sensitivity study"):
        check_unchanged(folder, replace=replace)
        with progress(len(cases)) as done:
            frame = run_cases(cases, folder / CASES, jobs=jobs, done=done)
        tasks = [case.task for case in cases]
        provenance = provenance_of(table.name, table.title, table.document(), tasks)
        page = write_sensitivity(folder, frame, provenance, replace=replace)
    return frame, page
