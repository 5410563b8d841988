"""Results in the terminal: the summary tables, parameters with intervals, and where all lies."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from frictionid.comparison.results import Results
from frictionid.files import plain
from frictionid.friction import Friction
from frictionid.friction.provenance import Estimate, Estimates
from frictionid.report.console import console
from frictionid.report.estimates import interval, value_text
from frictionid.report.sections import Section, score_tables, sections_of
from frictionid.report.shooting_results import shooting_results
from frictionid.report.side_by_side import (
    SideBySide,
    change_table,
    comparable_lines,
    score_table,
)
from frictionid.report.summary_table import (
    DETAILS,
    Summary,
    summary_numbers,
    summary_of,
    summary_table,
)
from frictionid.report.tables import Column, Table, for_terminal, line, render, text_columns
from frictionid.report.verdict import verdict_of


def show(results: Results) -> None:
    """Print the summary tables of a comparison, the verdict, and last a path to click on."""
    show_summary(results)
    _print_link((results.folder / "index.html").resolve())


def show_summary(results: Results) -> None:
    """Print the summary tables of a comparison, and the verdict."""
    sections = sections_of(results)
    for section in sections:
        failed = verdict_of(section).failed
        for data in section.data:
            unseen = "" if data.held_out else f" (fitted on {section.dataset}, never seen)"
            _print_summary(summary_of(data, failed), f"{data.dataset}{unseen}")
    for section in sections:
        words = verdict(section)
        text = f"{section.dataset}\n{words}\n" if len(sections) > 1 else f"{words}\n"
        out = console()
        out.print(text, markup=False, soft_wrap=not out.is_terminal)


def verdict(section: Section) -> str:
    """Which model the evidence supports, the main doubt, and what to record next."""
    found = {"verdict": verdict_of(section)}
    return render("verdict.md.j2", found, markup=False).strip()


def results_json(results: Results) -> str:
    """Summary tables and verdicts of a comparison as JSON text; null for what is not finite."""
    sections = sections_of(results)
    document = {
        "folder": results.folder,
        "page": str((results.folder / "index.html").resolve()),
        "summary": str((results.folder / "summary.md").resolve()),
        "datasets": [
            {
                "dataset": data.dataset,
                "fitted_on": section.dataset,
                "models": summary_of(data, verdict_of(section).failed).frame.to_dict("records"),
                "verdict": verdict(section) if data.held_out else "",
            }
            for section in sections
            for data in section.data
        ],
    }
    return json.dumps(plain(document, infinity=None), indent=1, allow_nan=False)


def show_side_by_side(found: SideBySide) -> None:
    """Print whether two results can be compared, and what changed."""
    out = console()
    for text in comparable_lines(found):
        out.print(text, markup=False, soft_wrap=True)
    if found.scores:
        show_table(score_table(found))
    changes = {
        "setting": found.settings,
        "version": found.versions,
        "model of one result": found.missing,
        "parameter": found.parameters,
    }
    for what, own in changes.items():
        if own:
            show_table(change_table(own, what))
        else:
            out.print(f"{what}: nothing changed", markup=False)


def side_by_side_json(found: SideBySide) -> str:
    """Two results side by side as JSON text; null for what is not finite."""
    document = found._asdict() | {"comparable": found.comparable}
    for name in ("settings", "versions", "scores", "parameters", "missing"):
        document[name] = [entry._asdict() for entry in document[name]]
    return json.dumps(plain(document, infinity=None), indent=1, allow_nan=False)


def show_scores(table: pd.DataFrame) -> None:
    """Print the scores of given models, a table with the columns of scores.csv, in short."""
    for dataset, own in table.groupby("dataset", sort=False):
        own = own.assign(task=own["identifier"])
        folds, level = score_tables(own)
        level = level.loc[own["task"].unique()]
        horizons = tuple(sorted(own["horizon_s"].dropna().unique()))
        joints = sorted(own[own["score"] == "curve_error"]["joint"].unique())
        frame = summary_numbers(level, folds, horizons, joints).reset_index(names="identifier")
        frame = frame.assign(recipe="", role="given")
        ahead = own[own["score"].str.startswith("rollout") & (own["statistic"] == "median")]
        units = {"1": "sizes"} | {unit: unit for unit in ("rad", "m")}
        unit = units[next(iter(ahead.loc[ahead["joint"] == "all", "unit"]), "rad")]
        _print_summary(Summary(frame, str(dataset), horizons, tuple(joints), unit), str(dataset))


def show_table(table: Table) -> None:
    """Print a table with its caption."""
    for text in (*for_terminal(table), table.caption, ""):
        console().print(text, soft_wrap=True, markup=False)


def show_refined(refined: Estimates) -> None:
    """Print the result of shooting: what makes it doubtful, parameters with intervals, findings."""
    found = {"found": shooting_results(refined)}
    for template in ("shooting_head.j2", "", "shooting_terminal.j2"):
        if template:
            text = render(template, found, markup=False).strip()
            console().print(text, markup=False, soft_wrap=True)
        else:
            for row in for_terminal(parameter_table(refined.parameters)):
                console().print(row, soft_wrap=True)


def parameter_table(read: Sequence[Estimate]) -> Table:
    """Parameters with their values, 95 % intervals and units."""
    columns = [
        *text_columns("parameter"),
        Column("value"),
        Column("95 % interval"),
        *text_columns("unit"),
    ]
    lines = [line((e.name, value_text(e), interval(e.low, e.high, e.error), e.unit)) for e in read]
    return Table("", "parameters", tuple(columns), tuple(lines))


def show_fit(friction: Friction) -> None:
    """Print a fitted friction: its parameters, with intervals where it was shot, and its words."""
    out, source = console(), friction.provenance
    if source.refined is not None:
        show_refined(source.refined)
    else:
        out.print(str(friction), markup=False, soft_wrap=True)
    if source.equation:
        lines = [f"with {source.equation_errors}:", *source.equation]
        out.print("\n  ".join(lines), markup=False, soft_wrap=True)
    if source.inclusion:
        lines = ["how often draws of the recordings had a term:", *source.inclusion]
        out.print("\n  ".join(lines), markup=False, soft_wrap=True)
    for sentence in (*source.equality, *source.torque):
        out.print(sentence, markup=False, soft_wrap=True)


def _print_summary(summary: Summary, title: str) -> None:
    """Print as much of the table as fits between the terminal's edges."""
    from rich.text import Text

    out = console()
    for detail in DETAILS:
        table = summary_table(summary, "", detail=detail, recipes=False, sd=False)
        lines = for_terminal(table)
        if max(line.cell_len for line in lines) <= out.width:
            break
    for text in (Text(title, style="bold"), *lines, Text()):
        out.print(text, soft_wrap=True)


def _print_link(path: Path) -> None:
    from rich.style import Style
    from rich.text import Text

    out = console()
    style = Style(link=path.as_uri()) if out.is_terminal else Style()
    out.print(Text(str(path), style=style), soft_wrap=True)
