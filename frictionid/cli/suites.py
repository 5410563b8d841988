"""frictionid compare, report, sensitivity and tune: run a suite, write its result folder anew."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

import frictionid as fid
from frictionid.errors import InputError

from .command import OtherFolder, ResultFolder, SuitePath, counted, interruptible, running

if TYPE_CHECKING:
    from frictionid.comparison.results import Results


def compare(
    suite: SuitePath,
    *,
    data: Path | None = None,
    out: Path | None = None,
    jobs: int = 0,
    dask: str | None = None,
    resume: bool = False,
    trust: bool = False,
    replace: bool = False,
    json: bool = False,
    require: list[str] | None = None,
) -> None:
    """Compare friction models on identical folds, and report which one the evidence supports.

    Parameters
    ----------
    data : Folder with the tables of the suite's one data set.
    out : Result folder [report/<suite>].
    jobs : Number of parallel tasks; 0: one per core.
    dask : Run the tasks on the cluster of the Dask scheduler at this address.
    resume : Keep finished tasks.
    replace : Replace results of another suite, or begin anew.
    """
    from joblib import cpu_count

    from frictionid.api.suites import open_suite
    from frictionid.report import results_json, show

    check_requirements(require)
    if dask and jobs:
        raise InputError("--jobs is for this computer, --dask for a cluster: give one of them")

    opened, _, folder, _ = open_suite(suite, data, out)
    with interruptible(f"what is done stays in {folder}: finish it with --resume"):
        results = fid.run_suite(
            suite,
            data=data,
            out=out,
            jobs=jobs,
            dask=dask,
            resume=resume,
            replace=replace,
            trust=trust,
            progress=partial(running, title=f"comparing ({opened.name})", jobs=jobs or cpu_count()),
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


def sensitivity(
    suite: SuitePath,
    *,
    data: Path | None = None,
    out: Path | None = None,
    identifier: list[str] | None = None,
    recipe: list[str] | None = None,
    jobs: int = 0,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Fit with one thing wrong at a time: parameters, delay, gain, tilt, noise, rate, recordings.

    Each variation is fitted and judged on held-out recordings; recipes that shoot come with base
    parameters held and free. Fits that are in the folder are kept.

    Parameters
    ----------
    data : Folder with the tables of the suite's one data set.
    out : Result folder [report/<suite>-sensitivity].
    identifier : Identifier of the suite; repeatable [its first parametric law].
    recipe : Recipe of the suite; repeatable [all of them].
    jobs : Number of parallel fits; 0: one per core.
    """
    from frictionid.api.sensitivity import sensitivity_of_suite
    from frictionid.files import json_text
    from frictionid.report.figures.studies import summarised
    from frictionid.report.sensitivity import sensitivity_table, studies
    from frictionid.report.terminal import show_table

    with interruptible("finished fits are kept: run the same command again"):
        frame, page = sensitivity_of_suite(
            suite,
            data=data,
            out=out,
            identifiers=identifier,
            recipes=recipe,
            jobs=jobs,
            replace=replace,
            trust=trust,
            progress=partial(counted, title="sensitivity"),
        )
    if json:
        rows = summarised(frame).to_dict(orient="records")
        print(json_text({"fits": rows, "written": [page]}), end="")
        return
    for _, part in studies(frame):
        show_table(sensitivity_table(part))
    print(f"written to {page.resolve()}")


def tune(
    suite: SuitePath,
    *,
    data: Path | None = None,
    out: Path | None = None,
    jobs: int = 0,
    resume: bool = False,
    json: bool = False,
    replace: bool = False,
    trust: bool = False,
) -> None:
    """Search settings of a suite's identifiers, and write those chosen as a suite.

    Parameters
    ----------
    data : Folder with the tables of the suite's one data set.
    out : Result folder [report/<suite>-tune].
    jobs : Number of parallel trials; 0: one per core.
    resume : Keep finished trials.
    """
    from frictionid.api.suites import open_suite
    from frictionid.report.sensitivity import outcome_json

    opened, _, folder, _ = open_suite(suite, data, out, "-tune")
    with interruptible(f"what is done stays in {folder}: finish it with --resume"):
        tuned = fid.tune(
            suite,
            data=data,
            out=out,
            jobs=jobs,
            resume=resume,
            replace=replace,
            trust=trust,
            progress=partial(counted, title=f"tuning ({opened.name})"),
        )
    if json:
        print(outcome_json(tuned.studies, tuned.page), end="")
        return
    tuned.show()
    print(f"written to {tuned.page.resolve()}")


def report(
    folder: ResultFolder,
    other: OtherFolder = None,
    *,
    json: bool = False,
    replace: bool = False,
    require: list[str] | None = None,
) -> None:
    """Rebuild page, tables and figures of a result folder, or say what changed to another one.

    Nothing is fitted. With two folders nothing is written.
    """
    if other is not None:
        if replace or require:
            raise InputError(
                "two folders are compared and nothing is written: without --replace and --require"
            )
        from frictionid.report import show_side_by_side, side_by_side_json

        comparison = fid.load_comparison(folder).against(fid.load_comparison(other))
        print(side_by_side_json(comparison)) if json else show_side_by_side(comparison)
        return
    from frictionid.comparison.result_folder import lock
    from frictionid.report import build, results_json, show

    check_requirements(require)
    # complains where there is nothing to report, before the lock
    results = fid.load_comparison(folder).results
    with lock(folder):
        build(results, replace=replace)
    print(results_json(results)) if json else show(results)
    exit_unless_met(results, require)


def check_requirements(requirements: Sequence[str] | None) -> None:
    """Refuse requirements that no verdict could meet, before anything is computed."""
    from frictionid.report.verdict import check_requirement

    for requirement in requirements or ():
        check_requirement(requirement)


def exit_unless_met(results: "Results", requirements: Sequence[str] | None) -> None:
    """Say on standard error which requirements the verdicts do not meet, and exit with 1."""
    from frictionid.report.sections import sections_of
    from frictionid.report.verdict import unmet, verdict_of

    if not requirements:
        return
    verdicts = [verdict_of(section) for section in sections_of(results)]
    lines = [(wanted, line) for wanted in requirements for line in unmet(verdicts, wanted)]
    for wanted, line in lines:
        typer.echo(f"frictionid: {line}, not {wanted.rpartition('=')[2]}", err=True)
    if lines:
        raise typer.Exit(1)
