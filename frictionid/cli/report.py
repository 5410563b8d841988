"""frictionid report: make tables and figures of a result folder anew."""

from __future__ import annotations

from frictionid.cli.paths import ResultFolder


def report(
    folder: ResultFolder,
) -> None:
    """Rebuild scores.csv, tables and figures of a result folder, without fitting anything."""
    from frictionid.comparison.results import load_results
    from frictionid.comparison.tasks import lock
    from frictionid.report import build, show

    results = load_results(folder)  # complains where there is nothing to report, before the lock
    with lock(folder):
        build(results)
    show(results)
