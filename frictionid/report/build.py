"""The report of a result folder: tables, pictures and summary, made anew from the tasks' files."""

from __future__ import annotations

from pathlib import Path

from frictionid.report.evidence import gather
from frictionid.report.scoreboard import board, summary_table
from frictionid.report.tables import markdown
from frictionid.results import reduce
from frictionid.store import write_text


def build(folder: Path) -> None:
    """Write scores.csv, models/, summary.md, tables/ and figures/ of a result folder; fits nothing.

    Raises
    ------
    InputError
        Where the folder holds no comparison, or none of its tasks is finished.
    """
    evidence = gather(folder)
    reduce(folder)
    pages = []
    for section in evidence.sections:
        for dataset in (section.dataset, *section.tests):
            table = board(section.entries, dataset, evidence.horizons, evidence.about[dataset])
            pages.append(markdown(summary_table(table, dataset)))
    write_text(folder / "summary.md", "\n".join(pages))
