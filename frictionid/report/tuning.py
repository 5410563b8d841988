"""What tuning found: tables, pictures and suites whose settings are those that were chosen."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from frictionid.comparison.search_space import Objective, text_of
from frictionid.comparison.tuning.studies import Found
from frictionid.comparison.tuning.tuned_suite import best_of, by_unit, chosen_suite
from frictionid.files import file_names, write_text
from frictionid.report.figures.tuning import write_progress
from frictionid.report.numbers import NOTHING, decimals, fixed, short
from frictionid.report.tables import Cell, Column, Line, Table, markdown


def write_outcome(folder: Path, found: Sequence[Found], objective: Objective, file: Path) -> Path:
    """Path of the page written, with trials.csv and a suite for each data set beside it."""
    write_text(folder / "trials.csv", trials(found).to_csv(index=False, float_format="%.9g"))
    suites = {}
    for name, own in _by_dataset(found):
        suites[name] = folder / f"{file_names([name])[name]}.toml"
        write_text(suites[name], chosen_suite(file, own, suites[name], objective))
    picture = write_progress(folder / "progress", found, objective)
    write_text(folder / "summary.md", _page(found, objective, suites, picture))
    return folder / "summary.md"


def trials(found: Sequence[Found]) -> pd.DataFrame:
    """All trials, one in a line: study, number, score on the inner folds, settings."""
    lines = [
        {
            "dataset": f.unit.benchmark.dataset.name,
            "identifier": f.unit.name,
            "fit": f.unit.recipe.name,
            "sampler": f.sampler,
            "fold": "all" if f.fold is None else f.fold,
            "trial": number,
            "value": trial.value,
            **{key: text_of(value) for key, value in trial.settings.items()},
            "error": trial.error,
        }
        for f in found
        for number, trial in enumerate(f.trials)
    ]
    return pd.DataFrame(lines)


def _by_dataset(found: Sequence[Found]) -> list[tuple[str, list[Found]]]:
    names = dict.fromkeys(f.unit.benchmark.dataset.name for f in found)
    return [(n, [f for f in found if f.unit.benchmark.dataset.name == n]) for n in names]


# --- Tables ---------------------------------------------------------------------------------------


def score_table(found: Sequence[Found], objective: Objective) -> Table:
    """Scores of each sampler's choice, on inner folds and on recordings held out from tuning."""
    unit = "rad" if objective.horizon is not None else "rad/s"
    lines, values = [], []
    for own in by_unit(found):
        for whole in (f for f in own if f.fold is None):
            nested = [f for f in own if f.sampler == whole.sampler and f.fold is not None]
            chosen, suites = (
                [getattr(f, name) for f in nested] for name in ("held_out", "held_out_own")
            )
            pairs = [(a, b) for a, b in zip(chosen, suites, strict=True)]
            lines.append((whole, chosen, suites, [b - a for a, b in pairs]))
            values += [whole.best.value, *chosen]
    places = decimals(values, 3)
    rows = [
        Line(
            (
                Cell(f"{whole.unit.name} ({whole.unit.recipe.name})"),
                Cell(whole.sampler),
                Cell(_trials(whole)),
                Cell(fixed(whole.own, places)),
                Cell(fixed(whole.best.value, places)),
                Cell(_spread(suites, places)),
                Cell(_spread(chosen, places)),
                Cell(_gain(gain, places)),
            ),
            whole.unit.title,
        )
        for whole, chosen, suites, gain in lines
    ]
    columns = (
        Column("identifier", words=True),
        Column("sampler", words=True),
        Column("trials"),
        Column("as in the suite", "inner folds", unit),
        Column("best", "inner folds", unit),
        Column("as in the suite", "held out", unit),
        Column("tuned", "held out", unit),
        Column("gain", "held out", unit),
    )
    caption = (
        f"{objective.words}. Inner folds: of all recordings; the best of many trials flatters "
        "itself. Held out: mean ± standard deviation over the outer folds, each tuned for itself "
        "without the recordings that judge it; gain: mean ± standard error of the difference."
    )
    return Table(caption, "tuning-scores", columns, tuple(rows))


def _trials(found: Found) -> str:
    failed = sum(math.isnan(t.value) for t in found.trials)
    return f"{len(found.trials)}" + (f" ({failed} failed)" if failed else "")


def _spread(values: Sequence[float], places: int) -> str:
    known = np.array([v for v in values if math.isfinite(v)])
    if not len(known):
        return NOTHING
    deviation = float(known.std(ddof=1)) if len(known) > 1 else math.nan
    return f"{fixed(float(known.mean()), places)} ± {fixed(deviation, places)}"


def _gain(values: Sequence[float], places: int) -> str:
    known = np.array([v for v in values if math.isfinite(v)])
    if len(known) < 2:
        return NOTHING
    error = float(known.std(ddof=1) / np.sqrt(len(known)))
    return f"{fixed(float(known.mean()), places + 1)} ± {fixed(error, places + 1)}"


def settings_table(found: Sequence[Found]) -> Table:
    """Settings of one unit: what was searched, what the suite has, what was chosen, how often."""
    unit = found[0].unit
    whole = [f for f in found if f.fold is None]
    own = {key: text_of(value) for key, value in unit.own.items()}
    columns = [Column("setting", words=True), Column("searched", words=True), Column("suite")]
    columns += [Column(f.sampler, "chosen on all data") for f in whole]
    nested = [f for f in found if f.fold is not None]
    if nested:
        columns.append(Column("chosen in the training folds", words=True))
    first = best_of(found)
    lines = []
    for key, space in unit.search.items():
        cells = [Cell(key), Cell(space.words), Cell(own.get(key, NOTHING))]
        cells += [Cell(_shown(f.best.settings[key]), f is first) for f in whole]
        if nested:
            cells.append(Cell(_range([f.best.settings[key] for f in nested])))
        lines.append(Line(tuple(cells)))
    caption = f"{unit.title}: settings searched and chosen; in bold those of the written suite."
    return Table(caption, "tuning-settings", tuple(columns), tuple(lines))


def settings_tables(found: Sequence[Found]) -> list[Table]:
    """The settings' table of each unit."""
    return [settings_table(own) for own in by_unit(found)]


def _shown(value: Any) -> str:
    return short(value, 3) if isinstance(value, float) else text_of(value)


def _range(values: Sequence[Any]) -> str:
    """Lowest to highest of numbers, or each choice with how often it was made."""
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        low, high = min(values), max(values)
        middle = sorted(values)[len(values) // 2]
        return f"{_shown(low)} to {_shown(high)}, median {_shown(middle)}"
    counts = Counter(map(text_of, values))
    return ", ".join(f"{name} ({times}×)" for name, times in counts.most_common())


def _page(
    found: Sequence[Found], objective: Objective, suites: Mapping[str, Path], picture: str
) -> str:
    parts = ["# Tuning\n"]
    for name, own in _by_dataset(found):
        parts += [f"## {name}\n", markdown(score_table(own, objective))]
        parts += [markdown(table) for table in settings_tables(own)]
        parts.append(
            f"The chosen settings as a suite: [{suites[name].name}]({suites[name].name})\n"
        )
    parts.append(f"![Lowest score over the trials]({picture}.png)\n")
    parts.append(
        "*The lowest score so far over the trials: on all data (thick) and in each training fold "
        f"(thin)* ([PDF]({picture}.pdf))\n"
    )
    return "\n".join(parts)
