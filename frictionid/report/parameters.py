"""Parameters of the models: mean and scatter over the folds, and the value from all data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.report.load import ANY, Entry, Section
from frictionid.report.numbers import NOTHING, fixed
from frictionid.report.shooting_numbers import estimates
from frictionid.report.tables import Cell, Column, Line, Table

DIGITS = 4  # significant, of the largest of a line


def parameter_numbers(section: Section) -> pd.DataFrame:
    """Numbers of every parameter of every model, one line each.

    Columns: identifier, recipe, role, joint, parameter, unit, mean, sd (over the folds), all_data,
    identified (by shooting; else nothing).
    """
    columns = (
        *("identifier", "recipe", "role", "joint", "parameter", "unit"),
        *("mean", "sd", "all_data", "identified"),
    )
    lines = [line for entry in section.entries for line in _lines(entry)]
    return pd.DataFrame(lines, columns=list(columns))


def _lines(entry: Entry) -> list[tuple[Any, ...]]:
    out = []
    read = estimates(entry.refined or {"parameters": ()})
    known = {(e.joint, e.short): e.identified for e in read if e.block == "friction"}
    sparse = "equation" in entry.model.get("provenance", {})
    for j, words in enumerate(entry.model.get("joints", ())):
        for i, (name, number) in enumerate(words.items()):
            folds = entry.theta[:, j, i]
            if sparse and number["value"] == 0 and not folds.any():
                continue
            fitted = entry.role == "fitted"
            mean = float(folds.mean()) if fitted else float("nan")
            sd = float(folds.std(ddof=1)) if fitted and len(folds) > 1 else float("nan")
            value = float("nan") if number["value"] is None else float(number["value"])
            head = (entry.label, entry.recipe, entry.role, j + 1)
            out.append((*head, name, number["unit"], mean, sd, value, known.get((j, name))))
    return out


def parameter_table(section: Section, joints: Sequence[str]) -> Table | None:
    """Table of the parameters, recipes side by side; None where no model has any."""
    frame = parameter_numbers(section)
    if frame.empty:
        return None
    recipes = [r for r in section.recipes if r in set(frame["recipe"])]
    heads = [Column("identifier", words=True), Column("joint", words=True)]
    heads += [Column("parameter", words=True), Column("unit", words=True)]
    for recipe in recipes:
        group = f"{recipe} recipe"
        heads += [Column("mean ± sd of folds", group), Column("all data", group)]
    given = bool((frame["recipe"] == ANY).any())
    heads += [Column("given")] if given else []
    order = ["identifier", "role", "joint", "parameter", "unit"]
    lines = []
    for key, own in frame.groupby(order, sort=False):
        name, role, joint, parameter, unit = map(str, key)
        cells = [Cell(text) for text in (name, joints[int(joint) - 1], parameter, unit)]
        lines.append(Line((*cells, *_values(own, recipes, given)), f"{role} {name}"))
    caption = (
        f"{section.dataset}: parameters of the fitted models, mean and standard deviation over the "
        "folds and the value from all data; given are numbers that no fit has changed."
    )
    if (frame["identified"].map(str) == "False").any():
        caption += " Not identified: at a bound or less sure than its own size, says shooting."
    return Table(caption, f"parameters-{section.dataset}", tuple(heads), tuple(lines))


def _values(own: pd.DataFrame, recipes: Sequence[str], given: bool) -> list[Cell]:
    """Cells of one parameter: two for each recipe, and one for a given value."""
    sizes = own[["mean", "all_data"]].to_numpy(dtype=float)
    sizes = np.abs(sizes[np.isfinite(sizes) & (sizes != 0)])
    places = int(np.clip(DIGITS - 1 - np.floor(np.log10(sizes.max())), 0, 9)) if sizes.size else 0
    cells = []
    for recipe in (*recipes, *([ANY] if given else [])):
        line = own[own["recipe"] == recipe]
        if line.empty:
            cells += [Cell(NOTHING)] * (1 if recipe == ANY else 2)
            continue
        mean, sd, value = (float(line[c].iloc[0]) for c in ("mean", "sd", "all_data"))
        if str(line["identified"].iloc[0]) == "False":
            cells += [Cell(_coarse(mean, sd)), Cell("not identified")]
            continue
        if recipe != ANY:
            spread = f"{fixed(mean, places)} ± {fixed(sd, places)}" if mean or sd else "0"
            cells.append(Cell(spread))
        cells.append(Cell(fixed(value, places) if value else "0"))
    return cells


def _coarse(mean: float, sd: float) -> str:
    """Mean and scatter of a parameter that is not identified, with two digits at the most.

    >>> _coarse(0.0017721, 0.0011), _coarse(30.0, 0.0)
    ('0.0018 ± 0.0011', '30 ± 0')
    """
    return " ± ".join(f"{float(f'{value:.2g}'):g}" for value in (mean, sd))
