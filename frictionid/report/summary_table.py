"""The summary tables: every model's scores on one data set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from frictionid.report.numbers import (
    NOTHING,
    decimals,
    divergence_limit,
    fixed,
    percent,
    seconds,
    short,
)
from frictionid.report.sections import (
    EULER,
    INTEGRAL,
    RIVALS,
    Model,
    SummaryData,
    over_folds,
    rollout,
)
from frictionid.report.tables import Cell, Column, Line, Table

ONE_STEP = {EULER: "euler mean", INTEGRAL: "integral rms"}
DETAILS = FULL, MEDIANS, LAST, BRIEF = "full", "medians", "last", "brief"  # ever narrower
TRUE_START = "rollout_true_start"


class Summary(NamedTuple):
    """Numbers of a summary table, one line for each model; see `summary_numbers`."""

    frame: pd.DataFrame
    dataset: str
    horizons: tuple[float, ...]
    joints: tuple[str, ...]  # with known true curves, else none
    unit: str


def summary_of(data: SummaryData, failed: Mapping[Model, Sequence[str]] | None = None) -> Summary:
    """Numbers of all models on one data set.

    failed : names of the physical checks that models fail, see `Verdict.failed`
    """
    columns = {"identifier": "label", "recipe": "recipe", "role": "role"}
    names = {key: [getattr(m, name) for m in data.models] for key, name in columns.items()}
    tasks, joints = [m.task for m in data.models], data.description.true_joints
    frame = pd.DataFrame(names, index=tasks).join(
        summary_numbers(data.level, data.folds, data.horizons, joints)
    )
    if failed:
        frame["implausible"] = ["; ".join(failed.get(model, ())) for model in data.models]
    unit = data.description.angle_unit
    return Summary(frame.reset_index(drop=True), data.dataset, data.horizons, joints, unit)


def summary_numbers(
    level: pd.DataFrame, folds: pd.DataFrame, horizons: Sequence[float], joints: Sequence[str]
) -> pd.DataFrame:
    """Numbers of each line: mean and deviation over folds one step ahead, all else pooled.

    The curve error is that of the friction fitted to all data; beside it stand mean and deviation
    over the folds. Where nothing was fitted to the data deviations are NaN.
    """
    curves = [f"curve_error_joint{joint}" for joint in joints]
    names = [rollout(h, s) for h in horizons for s in ("median", "q90", "diverged")]
    names += [rollout(h, s, TRUE_START) for h in horizons for s in ("median", "q90")]
    level = level.reindex(columns=[*ONE_STEP, *names, "free_run_mean", *curves, "n_parameters"])
    mean, sd = (over_folds(folds, statistic) for statistic in ("mean", "std"))
    mean = mean.reindex(level.index, columns=curves).fillna(level[curves]).add_suffix("_folds")
    return level.join([mean, sd.reindex(columns=[*ONE_STEP, *curves]).add_suffix("_sd")])


def summary_table(
    summary: Summary, caption: str, *, detail: str = FULL, recipes: bool = True, sd: bool = True
) -> Table:
    """The summary table.

    detail : how much is shown: all, the rollouts' medians, those of the last horizons, hardly more
    recipes : whether they have a column, else they head blocks of lines
    sd : whether the deviation over folds stands beside the one-step scores
    """
    parts = [(Column("identifier", words=True), list(map(Cell, summary.frame["identifier"])))]
    if recipes and (summary.frame["recipe"] != "").any():
        own = [Cell(recipe or NOTHING) for recipe in summary.frame["recipe"]]
        parts.append((Column("recipe", words=True), own))
    for name in list(ONE_STEP)[: 1 if detail == BRIEF else 2]:
        parts.append(_one_step(summary, name, sd, detail == BRIEF))
    shown = summary.horizons[-2:] if detail in (LAST, BRIEF) else summary.horizons
    parts += [_rollout(summary, h, detail == FULL or h == shown[-1]) for h in shown]
    parts += [*_true_start(summary), *_free_run(summary), *_curves(summary)]
    if detail != BRIEF:
        counts = [Cell(fixed(value, 0)) for value in summary.frame["n_parameters"]]
        parts.append((Column("parameters"), counts))
    parts += _implausible(summary)
    columns, cells = zip(*parts, strict=True)
    label = f"summary-{summary.dataset}"
    return Table(caption, label, columns, _lines(summary, zip(*cells, strict=True)))


def caption_of(data: SummaryData, summary: Summary) -> str:
    """Caption of a summary table."""
    parts = [f"{data.dataset}: fitted on {data.fitted_on}, never seen"]
    if data.held_out:
        parts = [f"{data.dataset}: held-out scores", "one step: mean ± sd over the folds"]
    shares = [rollout(h, "diverged") for h in summary.horizons]
    limit = divergence_limit(summary.unit)
    if (summary.frame[shares] > 0).any(axis=None):
        parts.append(f"rollouts: median (90 % quantile, share further off than {limit})")
    elif shares:
        parts.append(f"rollouts: median (90 % quantile), none further off than {limit}")
    if _true_start(summary):
        parts.append("from true states: against the true angles, with the memory of the motion")
    if summary.frame["free_run_mean"].notna().any():
        parts.append("free run: mean error over whole recordings, simulated from their start")
    if "implausible" in summary.frame:
        parts.append("implausible: physical checks that a model fails")
    return f"{'; '.join(parts)}. Best model in bold."


Part = tuple[Column, list[Cell]]  # heading, and cell of every line


def _one_step(summary: Summary, name: str, deviations: bool, brief: bool) -> Part:
    values, sd = summary.frame[name], summary.frame[f"{name}_sd"]
    places = decimals(values, 3)
    texts = [
        f"{fixed(v, places)} ± {fixed(d, places)}"
        if deviations and np.isfinite(v) and np.isfinite(d)
        else fixed(v, places)
        for v, d in zip(values, sd, strict=True)
    ]
    heading = ONE_STEP[name].partition(" ")[0] if brief else ONE_STEP[name]
    return _with_best(summary, Column(heading, "one step", f"{summary.unit}/s"), name, texts)


def _rollout(summary: Summary, horizon: float, full: bool) -> Part:
    names = [rollout(horizon, s) for s in ("median", "q90", "diverged")]
    median, q90, diverged = (summary.frame[name] for name in names)
    places, shares = decimals(median), (diverged > 0).any()
    texts = [
        f"{fixed(m, places)} ({short(q)}{f', {percent(d)}' if shares else ''})"
        if full and not np.isnan(m)
        else fixed(m, places)
        for m, q, d in zip(median, q90, diverged, strict=True)
    ]
    column = Column(seconds(horizon), "rollout", summary.unit, ", median (90 %)")
    return _with_best(summary, column, names[0], texts)


def _true_start(summary: Summary) -> list[Part]:
    """Errors of predictions from true states, at the last horizon alone."""
    if not summary.horizons:
        return []
    names = [rollout(summary.horizons[-1], s, TRUE_START) for s in ("median", "q90")]
    median, q90 = (summary.frame[name] for name in names)
    if median.isna().all():
        return []
    places = decimals(median)
    texts = [
        NOTHING if np.isnan(m) else f"{fixed(m, places)} ({short(q)})"
        for m, q in zip(median, q90, strict=True)
    ]
    heading = seconds(summary.horizons[-1])
    column = Column(heading, "from true states", summary.unit, ", median (90 %)")
    return [_with_best(summary, column, names[0], texts)]


def _free_run(summary: Summary) -> list[Part]:
    values = summary.frame["free_run_mean"]
    if values.isna().all():
        return []
    texts = [fixed(value, decimals(values)) for value in values]
    column = Column("mean", "free run", summary.unit)
    return [_with_best(summary, column, "free_run_mean", texts)]


def _curves(summary: Summary) -> list[Part]:
    names = [f"curve_error_joint{joint}" for joint in summary.joints]
    shares = 100 * summary.frame[names]
    # the truth's own error is its smoothing only
    places = min(decimals(shares.where(shares > 0.01).to_numpy().ravel()), 1)
    return [
        _with_best(
            summary,
            Column(f"joint {joint}", "curve error", "%"),
            name,
            [fixed(value, places) for value in shares[name]],
        )
        for joint, name in zip(summary.joints, names, strict=True)
    ]


def _implausible(summary: Summary) -> list[Part]:
    """Physical checks that models fail; no column where none fails any."""
    if "implausible" not in summary.frame:
        return []
    cells = [Cell(text or NOTHING) for text in summary.frame["implausible"]]
    return [(Column("implausible", words=True), cells)]


def _with_best(summary: Summary, column: Column, name: str, texts: Sequence[str]) -> Part:
    """A column in which the best of several models stands out, and all that look like it."""
    values = summary.frame[name].where(summary.frame["role"].isin(RIVALS), np.nan)
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return column, list(map(Cell, texts))
    first = texts[int(finite.idxmin())].split(" ")[0]
    return column, [
        Cell(text, bool(text.split(" ")[0] == first and np.isfinite(value)))
        for text, value in zip(texts, values, strict=True)
    ]


def _lines(summary: Summary, rows: Iterable[tuple[Cell, ...]]) -> tuple[Line, ...]:
    roles, recipes = summary.frame["role"], summary.frame["recipe"]
    several = len(set(recipes) - {""}) > 1
    return tuple(
        Line(cells, f"{role} {recipe}", f"{recipe} recipe" if several and recipe else "")
        for cells, role, recipe in zip(rows, roles, recipes, strict=True)
    )
