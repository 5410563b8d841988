"""Results in the terminal: the summary tables, what shooting found, and where everything lies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from frictionid.report.load import Scores, gather, horizons_of, scores_of
from frictionid.report.scoreboard import (
    DETAILS,
    Board,
    board,
    numbers_of,
    summary_table,
)
from frictionid.report.shooting_numbers import estimates, interval, value_words
from frictionid.report.shooting_text import doubts, findings
from frictionid.report.tables import Table, for_terminal

WIDTH = 120  # columns, where the output is no terminal
HEAD = ("parameter", "value", "95 % interval", "unit")


def show(folder: Path) -> None:
    """Print the summary tables of a result folder and, last, a path to click on."""
    evidence = gather(folder)
    console = _console()
    for section in evidence.sections:
        for dataset in (section.dataset, *section.tests):
            unseen = (
                f" (fitted on {section.dataset}, never seen)" if dataset in section.tests else ""
            )
            table = board(section.entries, dataset, evidence.horizons, evidence.about[dataset])
            _print(console, table, f"{dataset}{unseen}")
    _link(console, (folder / "summary.md").resolve())


def show_scores(table: pd.DataFrame) -> None:
    """Print the scores of given models, a table with the columns of scores.csv, in short."""
    console = _console()
    for dataset, own in table.groupby("dataset", sort=False):
        columns = ["fold", "score", "statistic", "horizon_s", "joint", "value", "unit"]
        lines = {
            str(name): scores_of(part[columns].itertuples(index=False))
            for name, part in own.groupby("identifier", sort=False)
        }
        _print(console, _given(str(dataset), lines), str(dataset))


def show_table(table: Table) -> None:
    """Print a table with its caption."""
    console = _console()
    for line in (*for_terminal(table), table.caption, ""):
        console.print(line, soft_wrap=True, markup=False)


def show_refined(document: Mapping[str, Any]) -> None:
    """Print what shooting found: parameters with their intervals, and the remarks."""
    from rich.table import Column
    from rich.table import Table as Rows

    console = _console()
    table = Rows(*(Column(name, no_wrap=True) for name in HEAD), box=None)
    for row in parameter_rows(document):
        table.add_row(*row)
    console.print(table)
    read = estimates(document)
    for sentence in (*findings(read), *doubts(document, read)):
        console.print(sentence, markup=False, soft_wrap=True)


def parameter_rows(document: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str]]:
    """Rows of name, value, 95 % interval and unit, as `document_of` has them."""
    for e in estimates(document):
        yield e.name, value_words(e), interval(e.low, e.high, e.error), e.unit


def _given(dataset: str, lines: dict[str, Scores]) -> Board:
    horizons = tuple(horizons_of(lines.values()))
    keys = {key for scores in lines.values() for key in scores}
    joints = tuple(sorted({key.joint for key in keys if key.score == "curve_error"}))
    rows = [
        {"identifier": name, "recipe": "", "role": "given", **numbers_of(scores, horizons, joints)}
        for name, scores in lines.items()
    ]
    return Board(pd.DataFrame(rows), dataset, horizons, joints, "rad")


def _console() -> Any:
    from rich.console import Console

    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=WIDTH)


def _print(console: Any, board: Board, title: str) -> None:
    """Print as much of the table as fits between the terminal's edges."""
    from rich.text import Text

    for detail in DETAILS:
        table = summary_table(board, "", detail=detail, recipes=False, deviations=False)
        lines = for_terminal(table)
        if max(line.cell_len for line in lines) <= console.width:
            break
    for line in (Text(title, style="bold"), *lines, Text()):
        console.print(line, soft_wrap=True)


def _link(console: Any, path: Path) -> None:
    from rich.style import Style
    from rich.text import Text

    style = Style(link=path.as_uri()) if console.is_terminal else Style()
    console.print(Text(str(path), style=style), soft_wrap=True)
