"""Rollout scores: how far predictions from many starts are off after given times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.evaluation.folds import Folds
from frictionid.evaluation.rows import Row, summarise_rollouts
from frictionid.friction import Friction, Inputs, Memory, Nodes, memory_along
from frictionid.mechanics import Plant
from frictionid.recordings import Dataset
from frictionid.rollout import Rollout, rollout
from frictionid.signals import averages, sample
from frictionid.states import States
from frictionid.step import State


class Starts(NamedTuple):
    """Rollouts to be made, S side by side over at most T intervals; behind a recording's end: NaN.

    recording, index (S,): where each starts; q, w (S, n): start states; u (T, S, n) [N m];
    dt (T, S) [s]; measured (T + 1, S, n) [rad]; truth the same or None; horizons (H,) [s] and
    last (H, S): interval count that reaches each horizon, -1 where the recording is too short;
    nodes: motion of all recordings up to the starts, for the friction's memory.
    """

    recording: Array
    index: Array
    q: Array
    w: Array
    u: Array
    dt: Array
    measured: Array
    truth: Array | None
    horizons: Array
    last: Array
    nodes: Nodes


def make_starts(
    dataset: Dataset,
    states: Sequence[States],
    plant: Plant,
    horizons: Sequence[float],
    *,
    every: float = 0.25,
    begin: float = 0.1,
) -> Starts:
    """Starts each `every` seconds in every recording, from `begin` on, as long as a horizon fits.

    `states` must be known from samples up to each time only (`Causal`) for a fair prediction.

    Raises
    ------
    InputError
        When no recording is long enough for the shortest horizon.
    """
    horizons_ = np.sort(np.asarray(horizons, dtype=float))
    chosen = [_indices(s.time, horizons_[0], every, begin) for s in states]
    if not sum(map(len, chosen)):
        raise InputError(
            f"data set {dataset.name!r}: no recording holds {begin + horizons_[0]:g} s of motion "
            f"for a rollout of {horizons_[0]:g} s: choose shorter horizons"
        )
    owner = np.repeat(np.arange(len(chosen)), [len(c) for c in chosen])
    index = np.concatenate(chosen)
    pairs = list(zip(owner, index, strict=True))
    last = np.stack([_reach(states[r].time, k, horizons_) for r, k in pairs], axis=1)
    T = int(last.max())
    torques = [averages(r.torque, s.time) for r, s in zip(dataset.recordings, states, strict=True)]
    measured = [sample(r.angle, s.time) for r, s in zip(dataset.recordings, states, strict=True)]
    known = all(r.truth is not None for r in dataset.recordings)
    steps = [np.diff(s.time)[:, None] for s in states]
    return Starts(
        recording=owner,
        index=index,
        q=np.stack([states[r].q[k] for r, k in pairs]),
        w=np.stack([states[r].w[k] for r, k in pairs]),
        u=_windows(torques, pairs, T, 0.0),
        dt=_windows(steps, pairs, T, 1e-3)[..., 0],
        measured=_windows(measured, pairs, T + 1, np.nan),
        truth=_windows(_truths(dataset, states), pairs, T + 1, np.nan) if known else None,
        horizons=horizons_,
        last=last,
        nodes=_nodes(dataset, states, plant),
    )


def _truths(dataset: Dataset, states: Sequence[States]) -> list[Array]:
    pairs = zip(dataset.recordings, states, strict=True)
    return [sample(r.truth.angle, s.time) for r, s in pairs if r.truth is not None]


def _indices(time: Array, shortest: float, every: float, begin: float) -> Array:
    wanted = np.arange(time[0] + begin, time[-1] - shortest + 1e-9, every)
    return np.unique(np.searchsorted(time, wanted - 1e-9))


def _reach(time: Array, index: int, horizons: Array) -> Array:
    """Intervals from a start to the sample nearest each horizon, -1 beyond the recording's end."""
    ahead = time[index:] - time[index]
    nearest = np.searchsorted((ahead[1:] + ahead[:-1]) / 2, horizons)
    tolerance = 0.5 * np.median(np.diff(time))
    return np.where(horizons <= ahead[-1] + tolerance, np.minimum(nearest, len(ahead) - 1), -1)


def _windows(
    series: Sequence[Array], pairs: Sequence[tuple[int, int]], length: int, fill: float
) -> Array:
    out = np.full((length, len(pairs), series[0].shape[1]), fill)
    for i, (r, k) in enumerate(pairs):
        part = series[r][k : k + length]
        out[: len(part), i] = part
    return out


def _nodes(dataset: Dataset, states: Sequence[States], plant: Plant) -> Nodes:
    parts = []
    for i, (recording, s) in enumerate(zip(dataset.recordings, states, strict=True)):
        u = sample(recording.torque, s.time)
        parts.append(Inputs(s.q, s.w, u, plant[i].load(s.q, s.w, u)))
    inputs = Inputs(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    first = np.concatenate([[0], np.cumsum([len(s.time) for s in states])])
    return Nodes(inputs, np.concatenate([s.time for s in states]), first)


def predict(plant: Plant, friction: Friction, starts: Starts) -> Rollout:
    """Motion from all starts; friction has one entry for each start, theta (S, n, P)."""
    state = State(starts.q, starts.w, _memory(friction, starts))
    return rollout(plant[starts.recording], friction, state, starts.u, starts.dt)


def _memory(friction: Friction, starts: Starts) -> Memory:
    """Memory at each start, from the motion before it."""
    probe = Inputs(*(x[:1] for x in starts.nodes.inputs))
    if not friction.law.start(friction.theta, probe):
        return ()
    unique, back = np.unique(np.asarray(friction.theta), axis=0, return_inverse=True)
    steps = memory_along(Friction(friction.law, unique), starts.nodes)  # entries (U, R, n)
    parts = range(len(steps[0]))
    chosen = zip(starts.index, back, starts.recording, strict=True)
    rows = [[steps[k][m][u, r] for m in parts] for k, u, r in chosen]
    return tuple(np.stack([row[m] for row in rows]) for m in parts)


def start_folds(starts: Starts, folds: Folds, states: Sequence[States]) -> Array:
    """Fold that holds out each start and horizon, (H, S); -1 where none does."""
    out = np.full(starts.last.shape, -1)
    for h, s in np.argwhere(starts.last >= 0):
        r, k = int(starts.recording[s]), int(starts.index[s])
        time = states[r].time
        fold = folds.whole(r, time[k], time[k + starts.last[h, s]])
        out[h, s] = -1 if fold is None else fold
    return out


def rollout_rows(motion: Rollout, starts: Starts, fold: Array) -> Iterator[Row]:
    """Rows for every horizon against the measured angles, and the true ones where they are known.

    fold (H, S) as `start_folds` gives it, or zeros where nothing was fitted to these data.
    """
    references = {"rollout_angle": starts.measured, "rollout_angle_truth": starts.truth}
    for score, reference in references.items():
        if reference is None:
            continue
        for h, horizon in enumerate(starts.horizons):
            use = (starts.last[h] >= 0) & (fold[h] >= 0)
            if not use.any():
                continue
            at = starts.last[h, use], np.flatnonzero(use)
            error = motion.q[at] - reference[at]
            yield from _horizon_rows(error, fold[h, use], score, float(horizon))


def _horizon_rows(error: Array, fold: Array, score: str, horizon: float) -> Iterator[Row]:
    norm = np.linalg.norm(error, axis=-1)
    for f in np.unique(fold):
        yield from summarise_rollouts(norm[fold == f], str(f), score, "all", horizon)
    yield from summarise_rollouts(norm, "all", score, "all", horizon)
    for j in range(error.shape[-1]):
        yield from summarise_rollouts(np.abs(error[:, j]), "all", score, str(j + 1), horizon)
