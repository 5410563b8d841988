"""frictionid report: make tables and figures of a result folder anew."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def report(
    folder: Annotated[Path, typer.Argument(help="Result folder of a comparison.")],
) -> None:
    """Rebuild scores.csv, tables and figures of a result folder, without fitting anything."""
    from frictionid.comparison.results import task_documents
    from frictionid.comparison.tasks import lock
    from frictionid.report import build, show

    task_documents(folder)  # complains where there is nothing to report, before the lock is made
    with lock(folder):
        build(folder)
    show(folder)
