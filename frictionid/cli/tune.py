"""frictionid tune: search settings of identifiers, nested in the training folds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from frictionid.cli.options import Json, Replace, Trust
from frictionid.cli.paths import SuitePath


def tune(
    suite: SuitePath,
    data: Annotated[
        Path | None, typer.Option(help="Folder with the tables of the suite's one data set.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Result folder [report/<suite>-tune].")] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, help="Number of trials of each study [the suite's].")
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=0, help="Number of parallel trials; 0: one per core.")
    ] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Keep finished trials.")] = False,
    json: Json = False,
    replace: Replace = False,
    trust: Trust = False,
) -> None:
    """Search settings of a suite's identifiers, and write those chosen as a suite."""
    from joblib import cpu_count

    from frictionid.cli.progress import counted
    from frictionid.comparison.result_folder import lock
    from frictionid.comparison.suite import load_suite
    from frictionid.comparison.tuning import study_specs, tuning_tasks
    from frictionid.comparison.tuning import tune as search
    from frictionid.outputs import check_unchanged, check_writable
    from frictionid.report.terminal import show_table
    from frictionid.report.tuning import outcome_json, score_table, settings_tables, write_outcome

    table = load_suite(suite)
    tuning = table.tune.model_copy(update={} if trials is None else {"trials": trials})
    folder = out or Path("report") / f"{table.name}-tune"
    check_writable(folder)
    try:
        tasks = tuning_tasks(table, suite, data, trust=trust)
        total = tuning.trials * len(study_specs(tasks, tuning))
        with (
            lock(folder, ["journal.log"], "tuning"),
            counted(total, f"tuning ({table.name})") as done,
        ):
            check_unchanged(folder, replace=replace)
            results = search(
                tasks,
                tuning,
                folder,
                resume=resume,
                replace_trials=replace,
                jobs=jobs or cpu_count(),
                done=done,
            )
            page = write_outcome(folder, results, tuning.objective, suite, replace=replace)
    except KeyboardInterrupt:
        typer.echo(
            f"frictionid: interrupted; what is done stays in {folder}: finish it with --resume",
            err=True,
        )
        raise typer.Exit(130) from None
    if json:
        print(outcome_json(results, page), end="")
        return
    for shown in (score_table(results, tuning.objective), *settings_tables(results)):
        show_table(shown)
    print(f"written to {page.resolve()}")
