"""The main question of the study: do hybrids beat physics alone, and models without physics.

Physics is a mechanism with friction from the textbook, or with none; a hybrid the same mechanism
with friction that was learned; a black box has no mechanism at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frictionid.report.findings import Contrast, contrast, contrasted
from frictionid.report.numbers import decimals, fixed
from frictionid.report.sections import Model, Section, SummaryData, rollout
from frictionid.report.tables import Cell, Column, Table, line, text_columns

FAMILIES = {
    "physics": "physics with textbook friction",
    "hybrid": "physics with learned friction",
    "black box": "no physics",
}
# laws whose form was learned, by their names in model files
LEARNED = (
    *("mlp", "window_mlp", "lstm", "ensemble", "TorchModule", "library", "table"),
    *("spline", "spline_asymmetric"),
)
NEAR = 0.1  # of the error of the best textbook friction


@dataclass(frozen=True)
class Exceptions:
    """Models that do not keep to a limit: within 10 % of, or better than, a reference model.

    contrasts : those that do not, each against the reference; total : how many models there are
    """

    reference: Model
    error: float
    total: int
    contrasts: tuple[Contrast, ...]


@dataclass(frozen=True)
class Families:
    """Findings on the families of models on one data set, after one horizon [s].

    versus_physics, versus_box : the best hybrid against the best models of the other families
    learned : hybrids that are not within 10 % of the best physics with textbook friction
    beaten : models with physics and friction that do not beat the best black box
    no_box : whether there are black boxes, none of them with a finite error
    """

    horizon: float
    versus_physics: Contrast | None
    versus_box: Contrast | None
    learned: Exceptions | None
    beaten: Exceptions | None
    no_box: bool


def family(model: Model) -> str:
    """Family of a model; "" for fixed numbers and the truth."""
    if model.role not in ("none", "fitted"):
        return ""
    if model.document.get("mechanism"):
        return "black box"
    return "hybrid" if model.document.get("law", {}).get("kind", "") in LEARNED else "physics"


def families(data: SummaryData) -> Families | None:
    """Findings on the families at the first reported horizon; None without predictions."""
    if not data.reported:
        return None
    column = rollout(data.reported[0])
    first = {f: data.best([m for m in data.models if family(m) == f], column) for f in FAMILIES}
    complete = all(first.values())
    own = {f: [m for m in _best_recipes(data, column) if family(m) == f] for f in FAMILIES}
    textbook, box = (data.best(own[f], column) for f in ("physics", "black box"))
    learned = _exceptions(data, own["hybrid"], textbook, column, 1 + NEAR)
    friction = [*own["physics"], *own["hybrid"]]
    return Families(
        data.reported[0],
        contrasted(data, first["hybrid"], first["physics"], column) if complete else None,
        contrasted(data, first["hybrid"], first["black box"], column) if complete else None,
        learned,
        _exceptions(data, friction, box, column, 1.0),
        bool(friction and own["black box"] and box is None),
    )


def _best_recipes(data: SummaryData, column: str) -> list[Model]:
    """Each fitted identifier under the recipe with which it predicts best."""
    by_label: dict[str, list[Model]] = {}
    for model in data.of_role("fitted"):
        by_label.setdefault(model.label, []).append(model)
    return [data.best(own, column) or own[0] for own in by_label.values()]


def _exceptions(
    data: SummaryData, models: Sequence[Model], reference: Model | None, column: str, limit: float
) -> Exceptions | None:
    """Models whose error exceeds the reference's times a limit; equal does not beat at limit 1."""
    if reference is None or not models:
        return None
    error = data.value(reference, column)
    values = {model: data.value(model, column) for model in models}
    kept = [m for m, v in values.items() if (v < error if limit == 1.0 else v <= limit * error)]
    far = tuple(contrast(data, m, reference, column) for m in models if m not in kept)
    return Exceptions(reference, error, len(models), far)


def family_table(section: Section) -> Table | None:
    """Median rollout errors of all models by family; None where a family is missing."""
    models = [(name, m) for name in FAMILIES for m in section.models if family(m) == name]
    places = [(data, h) for data in section.data for h in data.reported]
    if {name for name, _ in models} != set(FAMILIES) or not places:
        return None
    values = np.array([[data.value(m, rollout(h)) for data, h in places] for _, m in models])
    lowest = np.where(np.isfinite(values), values, np.inf).min(axis=0)
    digits = [decimals(column) for column in values.T]
    lines = []
    for (name, model), row in zip(models, values, strict=True):
        cells = [
            Cell(fixed(value, places), bool(value == low))
            for value, places, low in zip(row, digits, lowest, strict=True)
        ]
        lines.append(line([FAMILIES[name], model.name, *cells], name))
    columns = [Column(f"{d.dataset}, {h:g} s", unit=d.description.angle_unit) for d, h in places]
    return Table(
        f"Median {section.description.coordinate} error of predictions by what a model knows: on "
        f"held-out motion of {section.dataset}, and on data that no fit has seen.",
        f"question-{section.dataset}",
        (*text_columns("what it knows", "model"), *columns),
        tuple(lines),
    )
