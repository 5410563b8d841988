"""The summary tables: every identifier's scores on one data set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.report.load import Entry, Key, Scores, Section
from frictionid.report.numbers import NOTHING, decimals, far, fixed, percent, seconds, short
from frictionid.report.tables import Cell, Column, Line, Table

ONE_STEP = (("one_step_euler", "mean"), ("one_step_integral", "rms"))
DETAILS = FULL, MEDIANS, LAST, BRIEF = "full", "medians", "last", "brief"  # ever narrower


class Board(NamedTuple):
    """Numbers of a summary table, one line for each entry; see `numbers_of`."""

    frame: pd.DataFrame
    dataset: str
    horizons: tuple[float, ...]
    joints: tuple[str, ...]  # with known true curves, else none
    unit: str


def board(entries: Sequence[Entry], dataset: str, horizons: Sequence[float], about: Any) -> Board:
    """Numbers of all entries on one data set, described by its entry in datasets.json."""
    known = about["truth"] is not None
    joints = tuple(str(j + 1) for j in range(len(about["joints"]))) if known else ()
    scored = [entry for entry in entries if dataset in entry.scores]
    names = [{"identifier": e.label, "recipe": e.recipe, "role": e.role} for e in scored]
    values = [numbers_of(e.scores[dataset], horizons, joints) for e in scored]
    frame = pd.DataFrame([n | v for n, v in zip(names, values, strict=True)])
    return Board(frame, dataset, tuple(horizons), joints, about["angle_unit"])


def numbers_of(
    scores: Scores, horizons: Sequence[float], joints: Sequence[str]
) -> dict[str, float]:
    """Numbers of one line: mean and standard deviation over folds one step ahead, all else pooled.

    Where nothing was fitted to the data there are no folds: then the pooled value, deviation NaN.
    The curve error is that of the friction fitted to all data.
    """
    out: dict[str, float] = {}
    for score, statistic in ONE_STEP:
        mean, deviation = spread(scores, Key(score, statistic))
        out[f"{score}_{statistic}"] = mean
        out[f"{score}_{statistic}_sd"] = deviation
    for h in horizons:
        for statistic in ("median", "q90", "diverged"):
            name = f"rollout_angle_{statistic}_{h:g}s"
            out[name] = scores[Key("rollout_angle", statistic, h)]
        for statistic in ("median", "q90"):
            name = f"rollout_true_start_{statistic}_{h:g}s"
            out[name] = scores[Key("rollout_true_start", statistic, h)]
    out["free_run_mean"] = scores[Key("free_run", "mean")]
    for joint in joints:
        key = Key("curve_error", "rms", joint=joint)
        out[f"curve_error_joint{joint}"] = scores[key]
        out[f"curve_error_joint{joint}_folds"], out[f"curve_error_joint{joint}_sd"] = spread(
            scores, key
        )
    out["n_parameters"] = scores[Key("n_parameters", "count")]
    return out


def spread(scores: Scores, key: Key) -> tuple[float, float]:
    """Mean and standard deviation of a score over the folds; pooled value and NaN without folds."""
    each = scores.folds(key)
    if len(each) < 2:
        return scores[key], float("nan")
    mean = float(np.mean(each))
    return mean, float(np.std(each, ddof=1)) if np.isfinite(mean) else float("nan")


def summary_table(
    board: Board, caption: str, *, detail: str = FULL, recipes: bool = True, deviations: bool = True
) -> Table:
    """The summary table of a board.

    detail : how much is shown: all, the rollouts' medians, those of the last horizons, hardly more
    recipes : whether they have a column, else they head blocks of lines
    deviations : whether the scatter over folds stands beside the one-step scores
    """
    several = bool((board.frame["recipe"] != "").any())
    parts = [_names(board, recipes and several)]
    parts += _one_step(board, deviations, detail) + _rollouts(board, detail)
    parts += _true_start(board) + _free_run(board) + _curves(board)
    if detail != BRIEF:
        count = Column("parameters")
        parts.append(_column(board, count, "n_parameters", lambda v: fixed(v, 0), False))
    columns = [column for part in parts for column in part[0]]
    rows = [[cell for part in parts for cell in part[1][i]] for i in range(len(board.frame))]
    return Table(caption, f"summary-{board.dataset}", tuple(columns), tuple(_lines(board, rows)))


def caption_of(board: Board, section: Section) -> str:
    """Caption of a summary table."""
    parts = [f"{board.dataset}: fitted on {section.dataset}, never seen"]
    if board.dataset == section.dataset:
        parts = [f"{board.dataset}: held-out scores", "one step: mean ± sd over the folds"]
    shares = [f"rollout_angle_diverged_{h:g}s" for h in board.horizons]
    if any((board.frame[name] > 0).any() for name in shares):
        parts.append(f"rollouts: median (90 % quantile, share further off than {far(board.unit)})")
    elif shares:
        parts.append(f"rollouts: median (90 % quantile), none further off than {far(board.unit)}")
    if _true_start(board):
        parts.append("from true states: against the true angles, with the memory of the motion")
    if board.frame["free_run_mean"].notna().any():
        parts.append("free run: mean error over whole recordings, simulated from their start")
    return f"{'; '.join(parts)}. Best fitted model in bold."


Part = tuple[list[Column], list[list[Cell]]]  # headings, and cells of every line


def _names(board: Board, recipes: bool) -> Part:
    columns = [Column("identifier", words=True)]
    cells = [[Cell(name)] for name in board.frame["identifier"]]
    if recipes:
        columns.append(Column("recipe", words=True))
        cells = [
            [*own, Cell(r or NOTHING)] for own, r in zip(cells, board.frame["recipe"], strict=True)
        ]
    return columns, cells


def _one_step(board: Board, deviations: bool, detail: str) -> list[Part]:
    parts = []
    for score, statistic in ONE_STEP[:1] if detail == BRIEF else ONE_STEP:
        name = f"{score}_{statistic}"
        places = decimals(board.frame[name], 3)

        def text(value: float, deviation: float, places: int = places) -> str:
            shown = fixed(value, places)
            scatter = deviations and np.isfinite(deviation)
            return f"{shown} ± {fixed(deviation, places)}" if scatter else shown

        shown = map(text, board.frame[name], board.frame[f"{name}_sd"])
        scheme = score.removeprefix("one_step_")
        words = scheme if detail == BRIEF else f"{scheme} {statistic}"
        column = Column(words, "one step", f"{board.unit}/s")
        parts.append(_marked(board, column, name, list(shown)))
    return parts


def _rollouts(board: Board, detail: str) -> list[Part]:
    shown = board.horizons[-2:] if detail in (LAST, BRIEF) else board.horizons
    return [_rollout(board, h, detail == FULL or h == shown[-1]) for h in shown]


def _rollout(board: Board, horizon: float, full: bool) -> Part:
    median, q90, diverged = (
        board.frame[f"rollout_angle_{s}_{horizon:g}s"] for s in ("median", "q90", "diverged")
    )
    places = decimals(median)
    share = bool((diverged > 0).any())

    def text(m: float, q: float, d: float) -> str:
        if not full or np.isnan(m):
            return fixed(m, places)
        inside = f"{short(q)}, {percent(d)}" if share else short(q)
        return f"{fixed(m, places)} ({inside})"

    words = list(map(text, median, q90, diverged))
    name = f"rollout_angle_median_{horizon:g}s"
    column = Column(seconds(horizon), "rollout", board.unit, ", median (90 %)")
    return _marked(board, column, name, words)


def _true_start(board: Board) -> list[Part]:
    """What is off from true states, at the last horizon alone."""
    name = "rollout_true_start_{}_" + f"{board.horizons[-1]:g}s" if board.horizons else ""
    if not name or board.frame[name.format("median")].isna().all():
        return []
    median, q90 = (board.frame[name.format(s)] for s in ("median", "q90"))
    places = decimals(median)
    words = [
        NOTHING if np.isnan(m) else f"{fixed(m, places)} ({short(q)})"
        for m, q in zip(median, q90, strict=True)
    ]
    column = Column(seconds(board.horizons[-1]), "from true states", board.unit, ", median (90 %)")
    return [_marked(board, column, name.format("median"), words)]


def _free_run(board: Board) -> list[Part]:
    values = board.frame["free_run_mean"]
    if values.isna().all():
        return []
    places = decimals(values)
    column = Column("mean", "free run", board.unit)
    return [_marked(board, column, "free_run_mean", [fixed(v, places) for v in values])]


def _curves(board: Board) -> list[Part]:
    names = [f"curve_error_joint{joint}" for joint in board.joints]
    shares = [100 * value for name in names for value in board.frame[name] if value > 1e-4]
    places = min(decimals(shares), 1)  # the truth's own error is its smoothing only
    return [
        _column(
            board,
            Column(f"joint {joint}", "curve error", "%"),
            name,
            lambda v: fixed(100 * v, places),
            True,
        )
        for joint, name in zip(board.joints, names, strict=True)
    ]


def _column(
    board: Board, column: Column, name: str, text: Callable[[float], str], mark: bool
) -> Part:
    words = [text(value) for value in board.frame[name]]
    return _marked(board, column, name, words) if mark else ([column], [[Cell(w)] for w in words])


def _marked(board: Board, column: Column, name: str, words: Sequence[str]) -> Part:
    """A column in which the best of several fitted models stands out, and all that look like it."""
    values = board.frame[name].where(board.frame["role"] == "fitted", np.nan)
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return [column], [[Cell(w)] for w in words]
    first = words[int(finite.idxmin())].split(" ")[0]
    best = [w.split(" ")[0] == first and np.isfinite(v) for w, v in zip(words, values, strict=True)]
    return [column], [[Cell(w, bool(b))] for w, b in zip(words, best, strict=True)]


def _lines(board: Board, rows: Sequence[Sequence[Cell]]) -> list[Line]:
    recipes = [recipe for recipe in board.frame["recipe"] if recipe]
    several = any(a != b for a, b in pairwise(recipes))
    lines = []
    for cells, role, recipe in zip(rows, board.frame["role"], board.frame["recipe"], strict=True):
        title = f"{recipe} recipe" if several and recipe else ""
        lines.append(Line(tuple(cells), f"{role} {recipe}", title))
    return lines
