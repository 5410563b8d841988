"""Judging one friction on one data set: the same scores for whatever made it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.curves import curve_error, curve_rows, curves, velocity_grid
from frictionid.evaluation.folds import Folds
from frictionid.evaluation.one_step import held_out_residual, one_step_rows
from frictionid.evaluation.rollouts import (
    Starts,
    make_starts,
    predict,
    rollout_rows,
    start_folds,
)
from frictionid.evaluation.rows import Row
from frictionid.evaluation.truth import steady_state
from frictionid.friction import Friction
from frictionid.mechanics import Plant, plant_of
from frictionid.problem import Problem
from frictionid.recipe import INTEGRAL, STUDY, problem_of, states_of
from frictionid.recordings import Dataset
from frictionid.states import Causal, States


@dataclass(frozen=True)
class Protocol:
    """What is judged, and where: the same for all identifiers.

    horizons : [s]; every : [s] between rollout starts; history : [s] of each recording that nobody
    is scored on, at least the longest memory; sample_time : [s] between the samples used, None for
    all; seed : of every random choice in a fit.
    """

    horizons: tuple[float, ...] = (0.1, 0.25, 0.5, 1.0)
    every: float = 0.25
    history: float = 0.15
    sample_time: float | None = None


class Prepared(NamedTuple):
    """A data set made ready for judging under one set of mechanism parameters."""

    dataset: Dataset
    plant: Plant
    protocol: Protocol
    euler: Problem
    integral: Problem
    causal: tuple[States, ...]
    starts: Starts
    grid: Array


def prepare(
    dataset: Dataset, protocol: Protocol, parameters: Mapping[str, float] | None = None
) -> Prepared:
    """A data set made ready for judging: problems, causal starts, velocities for the curves.

    `parameters` replace the mechanism's, for models that bring their own.
    """
    plant = plant_of(dataset, parameters)
    causal = states_of(dataset, Causal(), protocol.sample_time)
    integral = problem_of(dataset, plant, INTEGRAL, protocol.sample_time, protocol.history)
    starts = make_starts(
        dataset,
        causal,
        plant,
        protocol.horizons,
        every=protocol.every,
        begin=protocol.history,
    )
    return Prepared(
        dataset=dataset,
        plant=plant,
        protocol=protocol,
        euler=problem_of(dataset, plant, STUDY, protocol.sample_time, protocol.history),
        integral=integral,
        causal=causal,
        starts=starts,
        grid=velocity_grid(speeds(dataset, integral)),
    )


def speeds(dataset: Dataset, problem: Problem) -> Array:
    """True velocities where they are known, else smoothed ones, (K, n)."""
    true = [r.truth.velocity.value for r in dataset.recordings if r.truth is not None]
    return np.concatenate(true) if true else problem.nodes.inputs.w


def judge_folds(
    friction: Friction, overall: Friction, prepared: Prepared, folds: Folds
) -> tuple[list[Row], list[dict[str, Any]]]:
    """Rows of held-out scores of the folds' frictions, and example motions."""
    rows: list[Row] = []
    for score, problem in (
        ("one_step_euler", prepared.euler),
        ("one_step_integral", prepared.integral),
    ):
        held = folds.held_out(problem.recording, problem.time)
        rows += one_step_rows(held_out_residual(friction, problem, held), held, score)
    starts = prepared.starts
    fold = start_folds(starts, folds, prepared.causal)
    # a start is predicted by the friction of the fold that holds out its shortest horizon
    owner = np.maximum(fold[0], 0)
    motion = predict(prepared.plant, friction[owner], starts)
    rows += rollout_rows(motion, starts, np.where(fold == owner, fold, -1))
    rows += curve_scores(friction, overall, prepared)
    rows.append(_count(friction))
    return rows, _examples(motion.q, prepared, friction_of="fold")


def judge(friction: Friction, prepared: Prepared) -> list[Row]:
    """Rows of scores of one friction (n, P) on data that it was not fitted to."""
    rows: list[Row] = []
    batch = friction[None]
    for score, problem in (
        ("one_step_euler", prepared.euler),
        ("one_step_integral", prepared.integral),
    ):
        whole = np.zeros(len(problem.r), dtype=int)
        rows += _pooled(one_step_rows(held_out_residual(batch, problem, whole), whole, score))
    starts = prepared.starts
    everyone = np.zeros(len(starts.recording), dtype=int)
    motion = predict(prepared.plant, batch[everyone], starts)
    rows += _pooled(rollout_rows(motion, starts, np.where(starts.last >= 0, 0, -1)))
    rows += _pooled(curve_scores(batch, friction, prepared))
    rows.append(_count(friction))
    return rows


def examples(friction: Friction, prepared: Prepared) -> list[dict[str, Any]]:
    """Example motions predicted by one friction (n, P)."""
    everyone = np.zeros(len(prepared.starts.recording), dtype=int)
    motion = predict(prepared.plant, friction[None][everyone], prepared.starts)
    return _examples(motion.q, prepared, friction_of="all")


def curve_scores(friction: Friction, overall: Friction, prepared: Prepared) -> list[Row]:
    """Curve errors, where the truth is known."""
    if prepared.dataset.truth is None:
        return []
    true = curves(steady_state(prepared.dataset.truth), prepared.grid)
    each = curve_error(curves(friction, prepared.grid), true, prepared.grid)
    return list(curve_rows(each, curve_error(curves(overall, prepared.grid), true, prepared.grid)))


def _pooled(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row.fold == "all"]


def _count(friction: Friction) -> Row:
    size = int(np.prod(friction.theta.shape[-2:]))
    return Row("all", "n_parameters", "count", None, "all", float(size), "1")


def _examples(
    q: Array, prepared: Prepared, friction_of: str, most: int = 3
) -> list[dict[str, Any]]:
    """Predicted and measured motion over the longest horizon, from starts spread over the data."""
    starts = prepared.starts
    full = np.flatnonzero(starts.last[-1] >= 0)
    if not len(full):
        full = np.arange(len(starts.recording))
    chosen = full[np.linspace(0, len(full) - 1, most + 2).round().astype(int)[1:-1]]
    out = []
    for s in np.unique(chosen):
        last = int(starts.last[:, s].max())
        recording = prepared.dataset.recordings[starts.recording[s]]
        begin = prepared.causal[starts.recording[s]].time[starts.index[s]]
        out.append(
            {
                "dataset": prepared.dataset.name,
                "recording": recording.name,
                "start_s": float(begin),
                "friction_of": friction_of,
                "time": np.concatenate([[0.0], np.cumsum(starts.dt[:last, s])]),
                "measured": starts.measured[: last + 1, s],
                "predicted": q[: last + 1, s],
            }
        )
    return out
