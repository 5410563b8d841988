"""frictionid report: make page, tables and figures of a result folder anew, or compare two."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import typer

import frictionid as fid
from frictionid.errors import InputError

from .options import OtherFolder, ResultFolder

if TYPE_CHECKING:
    from frictionid.comparison.results import Results


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
    from frictionid.report.verdict_table import check_requirement

    for requirement in requirements or ():
        check_requirement(requirement)


def exit_unless_met(results: "Results", requirements: Sequence[str] | None) -> None:
    """Say on standard error which requirements the verdicts do not meet, and exit with 1."""
    from frictionid.report.sections import sections_of
    from frictionid.report.verdict import verdict_of
    from frictionid.report.verdict_table import unmet

    if not requirements:
        return
    verdicts = [verdict_of(section) for section in sections_of(results)]
    lines = [(wanted, line) for wanted in requirements for line in unmet(verdicts, wanted)]
    for wanted, line in lines:
        typer.echo(f"frictionid: {line}, not {wanted.rpartition('=')[2]}", err=True)
    if lines:
        raise typer.Exit(1)
