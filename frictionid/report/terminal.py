"""Results in the terminal, the same as text or HTML: tables, verdicts, parameters, and kinds."""

import io
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from typing import Any

import pandas as pd

from frictionid.comparison.kind_descriptions import Entry, KindDescription
from frictionid.comparison.results import Results
from frictionid.evaluation import torque_frame
from frictionid.evaluation.score_frame import score_tables
from frictionid.files import finite_json
from frictionid.fitting.fit import estimates_of
from frictionid.friction import Friction
from frictionid.friction.provenance import Estimate, Estimates

from .numbers import interval_text, value_text, with_levels
from .sections import Section, sections_of
from .shooting_results import shooting_words
from .side_by_side import SideBySide, change_table, comparable_lines, score_table
from .summary_table import (
    DETAILS,
    Summary,
    summary_numbers,
    summary_of,
    summary_table,
    torque_frames,
    torque_sentence,
    torque_table,
)
from .tables import Table, for_terminal, render, table_of, text_columns
from .verdict import verdict_of

WIDTH = 120  # columns, where the output is no terminal

_RECORDER: ContextVar[Any] = ContextVar("recorder", default=None)


def console() -> Any:
    """Where results are printed: in colour in a terminal, as plain text into a pipe."""
    from rich.console import Console

    recorder = _RECORDER.get()
    if recorder is not None:
        return recorder
    out = Console(highlight=False)
    return out if out.is_terminal else Console(highlight=False, width=WIDTH)


def say(*parts: Any) -> None:
    """Print texts, which a terminal wraps between words, and tables, whose lines stay whole."""
    out = console()
    for part in parts:
        wraps = out.is_terminal and isinstance(part, str)
        out.print(part, markup=False, soft_wrap=not wraps)


def printed(show: Callable[[], object]) -> str:
    r"""What a function that prints results would print, as plain text.

    >>> printed(lambda: say("0.1 rad [1]"))
    '0.1 rad [1]\n'
    """
    recorder = _recorded(show)
    return str(recorder.export_text(styles=False))


def printed_html(show: Callable[[], object]) -> str:
    """What a function prints as HTML, in a terminal's colours."""
    recorder = _recorded(show)
    style = "white-space:pre;overflow-x:auto;font-family:monospace;line-height:1.25"
    return str(
        recorder.export_html(inline_styles=True, code_format=f'<pre style="{style}">{{code}}</pre>')
    )


class Shown(ABC):
    """A result that prints itself, at the prompt and in a notebook."""

    @abstractmethod
    def show(self) -> None:
        """Print it."""

    def __repr__(self) -> str:
        return printed(self.show).rstrip("\n")

    def _repr_html_(self) -> str:
        return printed_html(self.show)


def _recorded(show: Callable[[], object]) -> Any:
    from rich.console import Console

    recorder = Console(
        file=io.StringIO(), record=True, width=WIDTH, highlight=False, force_jupyter=False
    )
    token = _RECORDER.set(recorder)
    try:
        show()
    finally:
        _RECORDER.reset(token)
    return recorder


# --- Comparisons and fits -------------------------------------------------------------------------


def show(results: Results) -> None:
    """Print the summary tables of a comparison, the verdict, and last a path to click on."""
    from rich.style import Style
    from rich.text import Text

    show_summary(results)
    path = (results.folder / "index.html").resolve()
    say(Text(str(path), style=Style(link=path.as_uri() if console().is_terminal else None)))


def show_summary(results: Results) -> None:
    """Print the summary tables of a comparison, and the verdict."""
    sections = sections_of(results)
    for section in sections:
        failed = verdict_of(section).failed
        for data in section.data:
            unseen = "" if data.held_out else f" (fitted on {section.dataset}, never seen)"
            _print_summary(summary_of(data, failed), f"{data.dataset}{unseen}")
            left = torque_sentence(torque_frames(data))
            if left:
                say(left)
    for text in results.not_fitted:
        say(f"not fitted: {text}")
    for section in sections:
        words = verdict(section)
        say(f"{section.dataset}\n{words}\n" if len(sections) > 1 else f"{words}\n")


def verdict(section: Section) -> str:
    """Which model the evidence supports, the main doubt, and what to record next."""
    return render("verdict.md.j2", {"verdict": verdict_of(section)}, markup=False).strip()


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
        "not_fitted": results.not_fitted,
    }
    return finite_json(document)


def show_side_by_side(compared: SideBySide) -> None:
    """Print whether two results can be compared, and what changed."""
    say(*comparable_lines(compared))
    if compared.scores:
        show_table(score_table(compared))
    changes = {
        "setting": compared.settings,
        "version": compared.versions,
        "model of one result": compared.missing,
        "parameter": compared.parameters,
    }
    for what, changed in changes.items():
        if changed:
            show_table(change_table(changed, what))
        else:
            say(f"{what}: nothing changed")


def side_by_side_json(compared: SideBySide) -> str:
    """Two results side by side as JSON text; null for what is not finite."""
    return finite_json(compared._asdict() | {"comparable": compared.comparable})


def show_scores(table: pd.DataFrame) -> None:
    """Print the scores of given models, a table with the columns of scores.csv, in short."""
    for dataset, rows in table.groupby("dataset", sort=False):
        rows = rows.assign(task=rows["identifier"])
        folds, level = score_tables(rows)
        level = level.loc[rows["task"].unique()]
        horizons = tuple(sorted(rows["horizon_s"].dropna().unique()))
        joints = tuple(sorted(rows[rows["score"] == "curve_error"]["joint"].unique()))
        frame = summary_numbers(level, folds, horizons, joints).reset_index(names="identifier")
        frame = frame.assign(recipe="", role="given")
        medians = rows["score"].str.startswith("rollout") & (rows["statistic"] == "median")
        unit = next(iter(rows.loc[medians & (rows["joint"] == "all"), "unit"]), "rad")
        unit = "sizes" if unit == "1" else unit
        _print_summary(Summary(frame, str(dataset), horizons, joints, unit), str(dataset))


def show_table(table: Table) -> None:
    """Print a table with its caption."""
    say(table, table.caption, "")


def show_refined(refined: Estimates) -> None:
    """Print the result of shooting: what makes it doubtful, parameters with intervals, findings."""
    head, findings = shooting_words(refined)
    say(head, parameter_table(with_levels(refined)), findings)


def parameter_table(read: Sequence[Estimate], *, noise_alone: bool = False) -> Table:
    """Parameters with their values, 95 % intervals and units.

    noise_alone : whether intervals hold the noise, but not the bias of smoothed states
    """
    intervals = "interval of the noise alone" if noise_alone else "95 % interval"
    heads = (*text_columns("parameter"), "value", intervals, *text_columns("unit"))
    rows = ((e.name, value_text(e), interval_text(e), e.unit) for e in read)
    return table_of(heads, rows)


INTERVALS = {
    False: "intervals hold the noise, and the bias of smoothed states",
    True: "intervals hold the noise alone: they leave out the bias of smoothed states and are too "
    "narrow; fit with bias=True, or by shooting",
}


def show_fit(friction: Friction, joints: Sequence[str] = ()) -> None:
    """Print a fitted friction: its parameters, with intervals where they are known, and its words.

    joints : their names
    """
    source, estimates = friction.provenance, estimates_of(friction, joints)
    if source.refined is not None:
        show_refined(source.refined)
    elif estimates:
        say(parameter_table(estimates, noise_alone=source.noise_alone and source.pooled is None))
        say(*[INTERVALS[source.noise_alone]] * (source.half_widths is not None))
    else:
        say(str(friction))
    notes = {
        f"with {source.equation_errors}:": source.equation,
        "how often draws of the recordings had a term:": source.inclusion,
    }
    for head, lines in notes.items():
        if lines:
            say("\n  ".join([head, *lines]))
    say(*source.equality, *source.torque, *source.limits)
    show_torque_left({"model": torque_frame(source.torque_left)}, joints)


def show_torque_left(frames: Mapping[str, pd.DataFrame], joints: Sequence[str]) -> None:
    """Print the torque left by models, see `torque_table`; nothing where none was measured."""
    table = torque_table(frames, joints)
    if table is not None:
        say(table.caption, table)


def _print_summary(summary: Summary, title: str) -> None:
    """Print as much of the table as fits between the terminal's edges."""
    from rich.text import Text

    out = console()
    for detail in DETAILS:
        table = summary_table(summary, "", detail=detail, recipes=False, sd=False)
        lines = for_terminal(table)
        if max(line.cell_len for line in lines) <= out.width:
            break
    say(Text(title, style="bold"), *lines, Text())


# --- Kinds ----------------------------------------------------------------------------------------


def show_kinds(kinds: Sequence[KindDescription], hint: str) -> None:
    """Print each kind with the names and units of its parameters, and how to see `hint`."""
    for kind in kinds:
        console().print(kind.name, style="bold", markup=False)
        say(f"  {kind.summary}")
        if kind.parameters:
            names = ", ".join(f"{p.name} [{p.unit}]" for p in kind.parameters)
            say(f"  parameters: {names}")
        elif kind.settings:
            say(f"  settings: {', '.join(setting.name for setting in kind.settings)}")
    say(f"\n{hint}")


def show_kind(kind: KindDescription) -> None:
    """Print all of a kind: what it is, its parameters and its settings."""
    out = console()
    out.print(kind.name, style="bold", markup=False)
    for paragraph in filter(None, (kind.summary, *kind.details)):
        say(f"{paragraph}\n")
    for title, entries in (
        ("parameter", kind.parameters),
        ("setting", kind.settings),
        ("base parameter: what motion identifies", kind.base),
    ):
        if entries:
            out.print(_table(title, entries))


def _table(title: str, entries: Sequence[Entry]) -> object:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 1), title_justify="left")
    columns = {
        title: [entry.name for entry in entries],
        "default": [entry.default for entry in entries],
        "unit": [entry.unit for entry in entries],
        "meaning": [entry.meaning for entry in entries],
    }
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    for name in shown:
        table.add_column(name, header_style="bold")
    for cells in zip(*shown.values(), strict=True):
        table.add_row(*map(Text, cells))
    return table
