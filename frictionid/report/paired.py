"""Differences between models, paired over the folds, against the scatter of the folds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.report.load import Entry, Key, Section
from frictionid.report.numbers import NOTHING, decimals, fixed
from frictionid.report.scoreboard import ONE_STEP, spread
from frictionid.report.tables import Cell, Column, Line, Table

FEWEST = 3  # folds, below which a scatter says nothing
CLEAR = 2.0  # standard errors


class Pair(NamedTuple):
    """Mean difference over the folds with its standard error; NaN where one is not finite."""

    mean: float
    error: float
    folds: int

    @property
    def clear(self) -> bool | None:
        """Whether the difference exceeds two standard errors; None where that cannot be told."""
        if self.folds < FEWEST or not np.isfinite(self.mean):
            return None
        return bool(abs(self.mean) > CLEAR * self.error)


def paired(model: Entry, other: Entry, dataset: str, key: Key) -> Pair:
    """A model's score less another's, paired over the folds that have both.

    The standard error is that of independent folds; their training sets overlap, so that it is
    rather too small.
    """
    mine, theirs = model.scores[dataset], other.scores[dataset]
    names = [name for name in mine.fold_names(key) if name in theirs.fold_names(key)]
    pairs = [(mine[key._replace(fold=n)], theirs[key._replace(fold=n)]) for n in names]
    values = np.array([a - b if np.isfinite([a, b]).all() else np.nan for a, b in pairs])
    if len(values) < 2:
        return Pair(float("nan"), float("nan"), len(values))
    error = float(np.std(values, ddof=1) / np.sqrt(len(values)))
    return Pair(float(np.mean(values)), error, len(values))


def best(entries: Sequence[Entry], dataset: str, key: Key) -> Entry | None:
    """The entry of the lowest finite score; None where no entry has one.

    The score is the mean over folds one step ahead, and what is pooled over all folds else.
    """
    values = [level(entry, dataset, key) for entry in entries]
    known = [(v, i) for i, v in enumerate(values) if np.isfinite(v)]
    return entries[min(known)[1]] if known else None


def level(entry: Entry, dataset: str, key: Key) -> float:
    """The score as it stands in the summary table."""
    if dataset not in entry.scores:
        return float("nan")
    scores = entry.scores[dataset]
    return spread(scores, key)[0] if key.score.startswith("one_step") else scores[key]


def judged(horizons: Sequence[float]) -> list[Key]:
    """Keys of the scores that are compared in pairs."""
    keys = [Key(score, statistic) for score, statistic in ONE_STEP]
    return keys + [Key("rollout_angle", "median", h) for h in horizons]


def _true_starts(section: Section, keys: Sequence[Key]) -> list[Key]:
    """The key of predictions from true states over the last horizon, where there are any."""
    key = keys[-1]._replace(score="rollout_true_start")
    known = any(key in e.scores.get(section.dataset, {}) for e in section.entries)
    return [key] if keys[-1].horizon is not None and known else []


def differences(section: Section, horizons: Sequence[float], unit: str) -> Table | None:
    """Table of each model's difference to the best fitted one, in each score; None with one."""
    fitted, shown = section.of_role("fitted"), section.of_role("none", "fitted", "given", "truth")
    if len(fitted) < 2:
        return None
    columns, parts = [], []
    keys = judged(horizons)
    for key in (*keys, *_true_starts(section, keys)):
        first = best(fitted, section.dataset, key)
        columns.append(_column(key, unit))
        parts.append(_cells(shown, first, section.dataset, key))
    names = [Cell(entry.title) for entry in shown]
    rows = zip(names, *parts, strict=True)
    lines = [Line(tuple(row), e.role + e.recipe) for row, e in zip(rows, shown, strict=True)]
    caption = (
        f"{section.dataset}: differences to the best fitted model of each column, paired over the "
        "folds: mean ± standard error; ≈ within two standard errors. Medians of rollouts are those "
        "of each fold."
    )
    heads = (Column("model", words=True), *columns)
    return Table(caption, f"differences-{section.dataset}", heads, tuple(lines))


def _column(key: Key, unit: str) -> Column:
    if key.horizon is None:
        scheme = key.score.removeprefix("one_step_")
        return Column(f"{scheme} {key.statistic}", "one step", f"{unit}/s")
    start = "from true states" if key.score == "rollout_true_start" else "rollout"
    return Column(f"{key.horizon:g} s", start, unit, ", median")


def _cells(entries: Sequence[Entry], first: Entry | None, dataset: str, key: Key) -> list[Cell]:
    if first is None:
        return [Cell(NOTHING)] * len(entries)
    pairs = [paired(entry, first, dataset, key) for entry in entries]
    return [
        Cell("best", True) if entry is first else Cell(_difference(pair))
        for entry, pair in zip(entries, pairs, strict=True)
    ]


def _difference(pair: Pair) -> str:
    if pair.clear is None:
        return NOTHING
    places = decimals([pair.error])
    sign = "+" if pair.mean >= 0 else "−"
    words = f"{sign}{fixed(abs(pair.mean), places)} ± {fixed(pair.error, places)}"
    return words if pair.clear else f"≈ {words}"
