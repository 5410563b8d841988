"""Tables of what shooting found: parameters with intervals, and windows that do not count."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from frictionid.mechanics import mechanism_of, parameters_of
from frictionid.report.load import Entry
from frictionid.report.numbers import NOTHING
from frictionid.report.shooting_numbers import Estimate, digits, estimates, interval, value_words
from frictionid.report.shooting_text import change
from frictionid.report.tables import Cell, Column, Line, Table

MANY = 20  # parameters of one group that a table shows one by one
OWN = ("friction", "inertia")  # blocks that stand under their names, the rest is the calibration's
SIZES = ("inertia", "actuator")  # blocks in which what is told is a size, not an ideal


def group_of(estimate: Estimate, joints: Sequence[str]) -> str:
    """What a parameter belongs to: friction of a joint, inertia, or the calibration."""
    if estimate.block not in OWN:
        return "calibration"
    if estimate.joint is None or len(joints) == 1:
        return estimate.block
    return f"{estimate.block}, {joints[estimate.joint]}"


def groups(read: Sequence[Estimate], joints: Sequence[str]) -> list[tuple[str, list[Estimate]]]:
    """Estimates of each group, in the document's order."""
    return [(name, list(own)) for name, own in groupby(read, key=lambda e: group_of(e, joints))]


def interval_numbers(entry: Entry, about: Mapping[str, Any]) -> pd.DataFrame:
    """Every parameter in numbers, one line each.

    Columns: identifier, recipe, block, joint, parameter, unit, value, error, low_90, high_90,
    low_95, high_95, identified, at_bound, told, true.
    """
    lines = [
        {
            "identifier": entry.label,
            "recipe": entry.recipe,
            "block": e.block,
            "joint": "" if e.joint is None else about["joints"][e.joint],
            "parameter": e.short,
            "unit": e.unit,
            "value": e.value,
            "error": e.error,
            "low_90": e.inner[0],
            "high_90": e.inner[1],
            "low_95": e.low,
            "high_95": e.high,
            "identified": e.identified,
            "at_bound": e.at_bound,
            "told": np.nan if e.told is None else e.told,
            "true": np.nan if e.true is None else e.true,
        }
        for e in estimates(entry.refined or {"parameters": ()}, about)
    ]
    return pd.DataFrame(lines)


def interval_table(
    entry: Entry, dataset: str, about: Mapping[str, Any], given: Sequence[Entry] = ()
) -> Table:
    """Table of the parameters with intervals, beside what was told of them and what is true.

    given : models with fixed numbers, whose parameters of the same name stand beside
    """
    document = entry.refined or {"parameters": ()}
    read = estimates(document, about)
    beside = {e.label: numbers_beside(e, read, about) for e in given}
    beside = {name: numbers for name, numbers in beside.items() if numbers}
    told = any(e.told is not None and e.block in SIZES for e in read)
    true = any(e.true is not None for e in read)
    heads = [Column(name, words=True) for name in ("block", "parameter", "unit")]
    heads += [Column("value"), Column("95 % interval")]
    heads += [Column("told"), Column("against told")] if told else []
    heads += [Column("true")] if true else []
    heads += [Column(name) for name in beside]
    lines = []
    for name, own in groups(read, about["joints"]):
        for i, cells in enumerate(_cells(own, told, true, list(beside.values()))):
            lines.append(Line((Cell(name if i == 0 else ""), *map(Cell, cells)), name))
    label = f"shooting-{dataset}-{entry.label}-{entry.recipe}"
    return Table(_caption(entry, dataset, about, told), label, tuple(heads), tuple(lines))


def numbers_beside(
    entry: Entry, read: Sequence[Estimate], about: Mapping[str, Any]
) -> dict[str, float]:
    """A given model's own numbers for these parameters, by their names with the joint's."""
    out: dict[str, float] = {}
    table, own = about.get("mechanism"), entry.model.get("parameters")
    if table and own:
        mechanism = mechanism_of(table)
        base = mechanism.base(parameters_of(table, own)) + np.asarray(about.get("own_base", 0.0))
        out |= dict(zip(mechanism.base_names, map(float, base), strict=True))
    joints = entry.model["joints"]
    for e in read:
        if e.block != "friction" or e.joint is None or e.short not in joints[e.joint]:
            continue
        value = joints[e.joint][e.short]["value"]
        if value is not None:
            out[e.name] = float(value)
    return {e.name: out[e.name] for e in read if e.name in out}


def _cells(
    own: Sequence[Estimate], told: bool, true: bool, beside: Sequence[Mapping[str, float]]
) -> Iterator[list[str]]:
    """Cells of each parameter of a group behind the group's name."""
    if len(own) > MANY:
        known = sum(e.identified for e in own)
        rest = [NOTHING] * (2 * told + true + len(beside))
        yield [f"{len(own)} numbers", NOTHING, f"{known} identified", NOTHING, *rest]
        return
    for e in own:
        short = e.name if e.block not in OWN else e.short
        cells = [short, e.unit.replace("^2", "²"), value_words(e), interval(e.low, e.high, e.error)]
        off = f"{change(e)[0]} %" if e.identified and e.told and e.block in SIZES else NOTHING
        cells += [_beside(e.told, e), off] * told
        cells += [_beside(e.true, e)] * true
        cells += [_beside(numbers.get(e.name), e) for numbers in beside]
        yield [*cells[:2], *(cell.replace("-", "−") for cell in cells[2:])]


def _beside(value: float | None, e: Estimate) -> str:
    """A number as it stands beside the estimate, with as many digits."""
    if value is None:
        return NOTHING
    return f"{value:g}" if value == round(value) else digits(value, e.error)


def _caption(entry: Entry, dataset: str, about: Mapping[str, Any], told: bool) -> str:
    document = entry.refined or {}
    clusters = document["clusters"]
    among = "recordings" if clusters <= about["recordings"] else "stretches of time"
    words = (
        f"{dataset}: parameters of {entry.label} by shooting (recipe {entry.recipe}), from all "
        f"data; 95 % intervals from the scatter between {clusters} {among} (t distribution, "
        f"{document['freedom']} degrees of freedom)."
    )
    return f"{words} Told is what the data set's mechanism and log say." if told else words


def window_numbers(entry: Entry) -> pd.DataFrame:
    """Windows that do not count or are not explained, by recording and time.

    Columns: recording, begin_s, end_s, residual (in units of the noise), why.
    """
    columns = ("recording", "begin_s", "end_s", "residual", "why")
    document = entry.refined or {}
    lines = [
        (p["recording"], float(p["begin"]), float(p["end"]), float(p["size"]), words)
        for key, words in (("left_out", "left out"), ("unexplained", "not explained"))
        for p in document.get(key, ())
    ]
    return pd.DataFrame(lines, columns=list(columns)).sort_values(["recording", "begin_s"])


def window_table(entry: Entry, dataset: str) -> Table | None:
    """Table of these windows; None where every window counts and is explained."""
    frame = window_numbers(entry)
    if frame.empty:
        return None
    heads = (
        *(Column("recording", words=True), Column("from [s]"), Column("to [s]")),
        *(Column("residual [noise]"), Column("why", words=True)),
    )
    lines = [
        Line((Cell(str(name)), *map(Cell, (f"{a:.2f}", f"{b:.2f}", f"{size:.1f}", str(why)))))
        for name, a, b, size, why in frame.itertuples(index=False)
    ]
    caption = (
        f"{dataset}: windows of {entry.label} (recipe {entry.recipe}) that were left out, as their "
        "prediction jumps with their start state, or are not explained, with residuals of three "
        "times the angle noise and more."
    )
    return Table(caption, f"windows-{dataset}-{entry.label}-{entry.recipe}", heads, tuple(lines))
