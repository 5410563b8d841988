"""The main question of the study: do hybrids beat physics alone, and models without physics.

Physics is a mechanism with friction from the textbook, or with none; a hybrid the same mechanism
with friction that was learned; a black box has no mechanism at all.
"""

from __future__ import annotations

import numpy as np

from frictionid.report.numbers import decimals, fixed
from frictionid.report.sections import Model, Section, rollout
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


def family(model: Model) -> str:
    """Family of a model; "" for fixed numbers and the truth."""
    if model.role not in ("none", "fitted"):
        return ""
    if model.document.get("mechanism"):
        return "black box"
    return "hybrid" if model.document.get("law", {}).get("kind", "") in LEARNED else "physics"


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
