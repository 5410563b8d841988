"""What was pooled of several specimens, as a frame and as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from frictionid.errors import printable
from frictionid.report.estimates import digits, interval
from frictionid.report.numbers import short
from frictionid.report.tables import Column, Table, for_terminal, line, text_columns
from frictionid.report.terminal.console import console

COLUMNS = (
    *("block", "joint", "parameter", "unit", "value", "low_95", "high_95"),
    *("range_low", "range_high", "tau", "tau_low", "tau_high", "Q", "p_value", "models"),
)
_LEAST = 1e-4  # p-values below it are not told apart


def pooled_frame(document: Mapping[str, Any]) -> pd.DataFrame:
    """A line for each pooled parameter; joint is its number from 1, 0 for the machine as a whole.

    Columns: block, joint, parameter, unit; value, low_95, high_95: the mean of all specimens with
    its interval; range_low, range_high: 95 % range of another specimen; tau, tau_low, tau_high:
    standard deviation between specimens; Q, p_value: heterogeneity; models: how many.
    """
    lines = [
        (
            *(e["block"], 0 if e["joint"] is None else int(e["joint"]) + 1),
            str(e["name"]) if e["joint"] is None else str(e["name"]).rpartition(" of ")[0],
            *(e["unit"], float(e["value"]), *e["interval_95"], *e["range_95"]),
            *(float(e["tau"]), *e["tau_95"], float(e["Q"]), float(e["p_value"])),
            len(e["models"]),
        )
        for e in document["parameters"]
    ]
    return pd.DataFrame(lines, columns=list(COLUMNS))


def pooled_table(document: Mapping[str, Any]) -> Table:
    """The same for people."""
    columns = (
        *text_columns("parameter"),
        *(Column("mean"), Column("95 % interval"), Column("range of another specimen")),
        *(Column("tau"), *text_columns("unit"), Column("Q"), Column("p"), Column("models")),
    )
    lines = []
    for e in document["parameters"]:
        value, error = float(e["value"]), float(e["error"])
        inner, outer = (
            interval(float(low), float(high), error)
            for low, high in (e["interval_95"], e["range_95"])
        )
        words = str(e["name"]), digits(value, error), inner, outer, short(float(e["tau"]))
        spread = f"{e['Q']:.3g}", _p_value(float(e["p_value"])), str(len(e["models"]))
        lines.append(line((*words, str(e["unit"]), *spread)))
    return Table("", "pooled", columns, tuple(lines))


def _p_value(p: float) -> str:
    return f"{p:.2g}" if p >= _LEAST else f"<{_LEAST:g}"


def show_pooled(document: Mapping[str, Any]) -> None:
    """Print what was pooled, and what was left out."""
    out = console()
    for text in for_terminal(pooled_table(document)):
        out.print(text, soft_wrap=True)
    for sentence in document["left_out"]:
        out.print(printable(str(sentence)), markup=False, soft_wrap=True)
