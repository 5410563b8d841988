"""frictionid report: make tables and figures of a result folder anew."""

from __future__ import annotations

from frictionid.cli.options import Json, Replace, Require
from frictionid.cli.paths import ResultFolder


def report(
    folder: ResultFolder, json: Json = False, replace: Replace = False, require: Require = None
) -> None:
    """Rebuild scores.csv, tables and figures of a result folder, without fitting anything."""
    from frictionid.api.comparison import load_comparison
    from frictionid.cli.requirements import check_requirements, exit_unless_met
    from frictionid.comparison.result_folder import lock
    from frictionid.report import build, results_json, show

    check_requirements(require)
    results = load_comparison(
        folder
    ).results  # complains where there is nothing to report, before the lock
    with lock(folder):
        build(results, replace=replace)
    print(results_json(results)) if json else show(results)
    exit_unless_met(results, require)
