"""Rollout scores: how far predictions from many starts are off after given times."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.rollout import Rollout, rollout
from frictionid.dynamics.step import State
from frictionid.evaluation.model_observer import PrecedingSamples, found
from frictionid.evaluation.rollout_starts import InitialStates
from frictionid.evaluation.score_rows import Row, far, summarise_rollouts
from frictionid.friction import Friction, Memory, memory_along
from frictionid.mechanics import Plant


def predict(
    plant: Plant,
    friction: Friction,
    starts: InitialStates,
    preceding: PrecedingSamples | None = None,
) -> Rollout:
    """Motion from all starts; plant and friction have one entry for each start, theta (S, n, P).

    preceding : where each friction finds the start states itself, see `observer`
    """
    if preceding is None:
        state = State(starts.q, starts.w, _memory(friction, starts))
    else:
        state = found(plant, friction, preceding, starts)
    return rollout(plant, friction, state, starts.u, starts.dt)


def _memory(friction: Friction, starts: InitialStates) -> Memory:
    """Memory at each start, from the motion before it."""
    if not friction.law.has_memory:
        return ()
    unique, back = np.unique(np.asarray(friction.theta), axis=0, return_inverse=True)
    back = np.reshape(back, -1)  # NumPy 2.0 gives it more axes
    steps = memory_along(Friction(friction.law, unique), starts.nodes)  # entries (U, R, n)
    parts = range(len(steps[0]))
    chosen = zip(starts.index, back, starts.recording, strict=True)
    rows = [[steps[k][m][u, r] for m in parts] for k, u, r in chosen]
    return tuple(np.stack([row[m] for row in rows]) for m in parts)


def rollout_rows(
    motion: Rollout, starts: InitialStates, fold: Array, angle_unit: str = "rad"
) -> Iterator[Row]:
    """Rows for every horizon against the measured angles, and the true ones where they are known.

    fold (H, S) as `initial_state_folds` gives it, or zeros where nothing was fitted to these data.
    """
    limit = far(angle_unit, starts.measured)
    yield from _rows(motion, starts, starts.measured, fold, "rollout_angle", limit)
    if starts.truth is not None:
        yield from _rows(motion, starts, starts.truth, fold, "rollout_angle_truth", limit)


def true_start_rows(
    motion: Rollout, starts: InitialStates, fold: Array, angle_unit: str = "rad"
) -> Iterator[Row]:
    """Rows of predictions from true states, against the true angles."""
    assert starts.truth is not None
    limit = far(angle_unit, starts.truth)
    yield from _rows(motion, starts, starts.truth, fold, "rollout_true_start", limit)


def _rows(
    motion: Rollout, starts: InitialStates, reference: Array, fold: Array, score: str, limit: Array
) -> Iterator[Row]:
    for h, horizon in enumerate(starts.horizons):
        use = (starts.last[h] > 0) & (fold[h] >= 0)
        if not use.any():
            continue
        at = starts.last[h, use], np.flatnonzero(use)
        error = motion.q[at] - reference[at]
        yield from _horizon_rows(error, fold[h, use], score, float(horizon), limit)


def _horizon_rows(
    error: Array, fold: Array, score: str, horizon: float, limit: Array
) -> Iterator[Row]:
    norm, most = np.linalg.norm(error, axis=-1), float(limit.max())
    for f in np.unique(fold):
        yield from summarise_rollouts(norm[fold == f], str(f), score, "all", horizon, most)
    yield from summarise_rollouts(norm, "all", score, "all", horizon, most)
    for j, own in enumerate(limit):
        each = np.abs(error[:, j])
        yield from summarise_rollouts(each, "all", score, str(j + 1), horizon, float(own))
