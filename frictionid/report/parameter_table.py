"""Parameters of the models: mean and deviation over the folds, and the value from all data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.report.estimates import estimates
from frictionid.report.numbers import NOTHING, fixed
from frictionid.report.sections import ANY, Model, Section
from frictionid.report.shooting_tables import NONE
from frictionid.report.tables import Cell, Column, Table, line, text_columns

DIGITS = 4  # significant, of the largest of a line
COLUMNS = (
    *("identifier", "recipe", "role", "joint", "parameter", "unit"),
    *("mean", "sd", "all_data", "identified"),
)


def parameter_numbers(section: Section) -> pd.DataFrame:
    """Numbers of every parameter of every model, one line each.

    Columns: identifier, recipe, role, joint, parameter, unit, mean, sd (over the folds), all_data,
    identified (by shooting; else nothing).
    """
    lines = [line for model in section.models for line in _numbers(model)]
    return pd.DataFrame(lines, columns=list(COLUMNS))


def _numbers(model: Model) -> Iterator[tuple[Any, ...]]:
    read = estimates(model.refined or NONE)
    identified = {(e.joint, e.parameter): e.identified for e in read if e.block == "friction"}
    sparse = "equation" in model.document.get("provenance", {})
    for j, parameters in enumerate(model.document.get("joints", ())):
        for i, (name, number) in enumerate(parameters.items()):
            folds = model.theta[:, j, i]
            if sparse and number["value"] == 0 and not folds.any():
                continue
            fitted = model.role == "fitted"
            mean = float(folds.mean()) if fitted else float("nan")
            sd = float(folds.std(ddof=1)) if fitted and len(folds) > 1 else float("nan")
            value = float("nan") if number["value"] is None else float(number["value"])
            head = (model.label, model.recipe, model.role, j + 1, name, number["unit"])
            yield (*head, mean, sd, value, identified.get((j, name)))


def parameter_table(section: Section, frame: pd.DataFrame) -> Table:
    """Table of the parameters of `parameter_numbers`, recipes side by side."""
    recipes = [recipe for recipe in section.recipes if recipe in set(frame["recipe"])]
    heads = text_columns("identifier", "joint", "parameter", "unit")
    for recipe in recipes:
        group = f"{recipe} recipe"
        heads += [Column("mean ± sd of folds", group), Column("all data", group)]
    given = [ANY] if (frame["recipe"] == ANY).any() else []
    heads += [Column("given") for _ in given]
    order = ["identifier", "role", "joint", "parameter", "unit"]
    lines = []
    for key, own in frame.groupby(order, sort=False):
        name, role, joint, parameter, unit = map(str, key)
        cells = [name, section.description.joints[int(joint) - 1], parameter, unit]
        lines.append(line([*cells, *_values(own, [*recipes, *given])], f"{role} {name}"))
    caption = (
        f"{section.dataset}: parameters of the fitted models, mean and standard deviation over the "
        "folds and the value from all data; given: numbers that no fit has changed."
    )
    if (frame["identified"].map(str) == "False").any():
        caption += " Not identified (shooting): at a bound, or standard error too large."
    return Table(caption, f"parameters-{section.dataset}", tuple(heads), tuple(lines))


def _values(own: pd.DataFrame, recipes: Sequence[str]) -> list[str | Cell]:
    """Cells of one parameter: two for each recipe, and one for a given value."""
    sizes = own[["mean", "all_data"]].to_numpy(dtype=float)
    sizes = np.abs(sizes[np.isfinite(sizes) & (sizes != 0)])
    places = int(np.clip(DIGITS - 1 - np.floor(np.log10(sizes.max())), 0, 9)) if sizes.size else 0
    cells: list[str | Cell] = []
    for recipe in recipes:
        found = own[own["recipe"] == recipe]
        if found.empty:
            cells += [NOTHING] * (1 if recipe == ANY else 2)
            continue
        mean, sd, value = found[["mean", "sd", "all_data"]].to_numpy(dtype=float)[0]
        if str(found["identified"].iloc[0]) == "False":
            cells += [_coarse(mean, sd), Cell("not identified", mark="unknown")]
            continue
        if recipe != ANY:
            cells.append(f"{fixed(mean, places)} ± {fixed(sd, places)}" if mean or sd else "0")
        cells.append(fixed(value, places) if value else "0")
    return cells


def _coarse(mean: float, sd: float) -> str:
    """Mean and deviation of a parameter that is not identified, with two digits at the most.

    >>> _coarse(0.0017721, 0.0011), _coarse(30.0, 0.0)
    ('0.0018 ± 0.0011', '30 ± 0')
    """
    return " ± ".join(f"{float(f'{value:.2g}'):g}" for value in (mean, sd))
