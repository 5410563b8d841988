"""Differences between models, paired over the folds, against the scatter of the folds."""

from __future__ import annotations

from frictionid.evaluation.statistics import Pair
from frictionid.report.numbers import MINUS, NOTHING, decimals, fixed
from frictionid.report.sections import RIVALS, SummaryData, rollout
from frictionid.report.summary_table import ONE_STEP, TRUE_START
from frictionid.report.tables import Cell, Column, Table, line, text_columns


def difference_table(data: SummaryData) -> Table | None:
    """Table of each model's difference to the best one, in each score; None with one."""
    rivals = data.of_role(*RIVALS)
    if len(rivals) < 2:
        return None
    unit = data.description.angle_unit
    heads = {name: Column(text, "one step", f"{unit}/s") for name, text in ONE_STEP.items()}
    for h in data.horizons:
        heads[rollout(h)] = Column(f"{h:g} s", "rollout", unit, ", median")
    last = rollout(data.horizons[-1], score=TRUE_START) if data.horizons else ""
    if last in data.level:
        heads[last] = Column(f"{data.horizons[-1]:g} s", "from true states", unit, ", median")
    lines = []
    best = {name: data.best(rivals, name) for name in heads}
    for model in data.models:
        cells = [
            NOTHING
            if first is None
            else Cell("best", True)
            if first is model
            else _difference(data.paired(model, first, name))
            for name, first in best.items()
        ]
        lines.append(line([model.name, *cells], model.role + model.recipe))
    caption = (
        f"{data.dataset}: differences to the best model of each column, paired over the folds: "
        "mean ± standard error of the corrected t-test; ≈ where its 95 % interval holds zero. "
        "Medians of rollouts are those of each fold."
    )
    columns = (*text_columns("model"), *heads.values())
    return Table(caption, f"differences-{data.dataset}", columns, tuple(lines))


def _difference(pair: Pair) -> str:
    if pair.clear is None:
        return NOTHING
    places = decimals([pair.error])
    sign = "+" if pair.mean >= 0 else MINUS
    text = f"{sign}{fixed(abs(pair.mean), places)} ± {fixed(pair.error, places)}"
    return text if pair.clear else f"≈ {text}"
