"""Initial states by the model itself: from the samples up to the start, with its own physics.

What a kinematic filter knows of a velocity comes from the last few angles only; a model knows how
the joints must have moved to have come here. Over the last samples before each start the motion
that the model predicts is fitted to the measured angles, as shooting does it, with the state at
their begin free; where it ends, the rollout starts. It is causal, and the same for all models.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.data.states import States
from frictionid.dynamics.step import State
from frictionid.dynamics.step_size import step_size_of
from frictionid.evaluation.initial_states import InitialStates
from frictionid.friction import Friction, Inputs
from frictionid.mechanics import Plant
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting.intervals import Track, torques, track_of
from frictionid.shooting.law_derivatives import Free, seen_by
from frictionid.shooting.linearise import Lines
from frictionid.shooting.variational import Forces, Scene, ends
from frictionid.shooting.windows import Chain, chained, eliminated

SAMPLES = 20
_ROUNDS = 6
_HUBER = 2.5  # [noise]
_ROWS = 4000  # intervals at a time, for the cache's sake
_PIECE, _FINE = 0.009, 0.0007  # [s] of the physics step, away from rest and near it
_START = 1.0  # [rad/s], how far a velocity may be from the filter's
_LOST = 0.3  # [rad]


class PrecedingSamples(NamedTuple):
    """The intervals before S initial, one after the other, each with its own copy.

    track : (K,) intervals; windows (S, N), their indices, -1 behind a window's end; u (pieces, K,
    n) [N m]; sigma (n,) [rad], about the noise of the angles
    """

    track: Track
    windows: Array
    u: Array
    sigma: Array

    @property
    def owner(self) -> Array:
        """Start (K,) that each interval leads to."""
        return np.repeat(np.arange(len(self.windows)), (self.windows >= 0).sum(axis=1))

    def with_rows(self, other: PrecedingSamples, rows: Array) -> PrecedingSamples:
        """The preceding samples with some (K,) rows of another calibration of the same data."""
        names = ("before", "after", "q", "w")
        new = {}
        for name in names:
            value = getattr(self.track, name).copy()
            value[rows] = getattr(other.track, name)[rows]
            new[name] = value
        u = self.u.copy()
        u[:, rows] = other.u[:, rows]
        return self._replace(track=replace(self.track, **new), u=u)


def preceding_samples(
    dataset: Dataset, states: Sequence[States], initial: InitialStates
) -> PrecedingSamples:
    """What is known before each start: up to 20 samples, with filtered states (`KalmanFilter`)."""
    track = track_of(dataset, states=tuple(states))
    sizes = np.array([len(s.time) for s in states])
    place = np.full(int(sizes.sum()), -1)
    first = np.concatenate([[0], np.cumsum(sizes)])
    place[first[track.recording] + track.index] = np.arange(len(track.time))
    rows, windows = [], np.full((len(initial.index), SAMPLES), -1)
    count = 0
    for s, (r, k) in enumerate(zip(initial.recording, initial.index, strict=True)):
        own = place[first[r] + max(0, k - SAMPLES) : first[r] + k]
        whole = own >= 0
        own = own[(np.flatnonzero(~whole)[-1] + 1 if (~whole).any() else 0) :]  # behind a gap
        windows[s, : len(own)] = count + np.arange(len(own))
        rows.append(own)
        count += len(own)
    index = np.concatenate(rows).astype(int)
    part = track.take(index)
    pieces = int(np.ceil(float(np.median(part.dt)) / _PIECE - 1e-6))
    u, _ = torques(part, Calibration.ideal(track.n), np.arange(len(index)), max(pieces, 1))
    driven = np.array([np.any(r.torque.value, axis=0) for r in dataset.recordings]).any(axis=0)
    sigma = 1.4826 * np.median(np.abs(track.before - track.q), axis=0)
    return PrecedingSamples(part, windows, u * driven, np.maximum(sigma, 1e-6))


def estimate_initial_states(
    plant: Plant, friction: Friction, preceding: PrecedingSamples, initial: InitialStates
) -> State:
    """Initial states (S, n), with memory, of frictions (S, n, P) on plants with one entry each.

    Where a model finds no motion that leads to the initial state, that of the filter stands.
    """
    track, windows, n, sigma = (
        preceding.track,
        preceding.windows,
        preceding.track.n,
        preceding.sigma,
    )
    owner = preceding.owner
    nodes = _begin(friction, preceding, owner)
    known = windows[:, 0] >= 0
    some = windows[known]
    offset = np.zeros(n)
    lines = _lines(plant, friction, preceding, owner, nodes)
    for _ in range(_ROUNDS):
        with np.errstate(all="ignore"):
            chain = chained(track, lines, nodes, some, offset)
            nodes = _moved(chain, nodes, some, track, sigma)
            lines = _lines(plant, friction, preceding, owner, nodes)
    chain = chained(track, lines, nodes, some, offset)
    gap = np.abs(chain.moved[..., :n]).max(axis=(1, 2))
    last = some.max(axis=1)
    state = State(initial.q.copy(), initial.w.copy(), _memory(friction, initial))
    end = lines.end[last]
    near = np.abs(end[:, :n] - track.after[last]).max(axis=-1) < _LOST
    good = np.flatnonzero(known)[near & (gap < 10.0 * sigma.max()) & np.isfinite(end).all(-1)]
    at = windows[good].max(axis=1)
    state.q[good], state.w[good] = lines.end[at, :n], lines.end[at, n : 2 * n]
    for m, entry in enumerate(state.memory):
        entry[good] = lines.end[at, (2 + m) * n : (3 + m) * n]
    return state


def _memory(friction: Friction, initial: InitialStates) -> tuple[Array, ...]:
    zero = 0.0 * initial.q
    first = friction.law.start(friction.theta, Inputs(initial.q, initial.w, zero, zero))
    return tuple(np.array(np.broadcast_to(z, initial.q.shape)) for z in first)


def _begin(friction: Friction, preceding: PrecedingSamples, owner: Array) -> Array:
    """Nodes (K, s): the filter's states; laws that remember begin anew in each."""
    track = preceding.track
    zero = 0.0 * track.q
    x = Inputs(track.q, track.w, preceding.u[0], zero)
    memory = friction.law.start(friction.theta[owner], x)
    return np.concatenate(
        [track.q, track.w, *(np.broadcast_to(z, track.q.shape) for z in memory)], axis=-1
    )


def _lines(
    plant: Plant, friction: Friction, preceding: PrecedingSamples, owner: Array, nodes: Array
) -> Lines:
    track, n = preceding.track, preceding.track.n
    K, s = nodes.shape
    out = Lines(np.empty((K, s)), np.empty((K, s, s)), np.zeros((K, s, 0)), np.zeros((0, n)))
    none = Free(np.zeros(0, int), np.zeros(0, int))
    probe = Inputs(*(x[:64] for x in (track.q, track.w, preceding.u[0], 0.0 * track.q)))
    seen = seen_by(friction.law, friction.theta[owner[:64]], probe)
    pieces = len(preceding.u)
    part = float(track.dt.max()) / pieces
    fine = max(1, int(np.ceil(part / _FINE)))
    step_size_of(plant, friction, part)  # complains about laws that no step resolves
    for rows in np.array_split(np.arange(K), max(1, -(-K // _ROWS))):
        scene = Scene(plant[owner[rows]], friction[owner[rows]], none, (), seen)
        memory = tuple(nodes[rows, i : i + n] for i in range(2 * n, s, n))
        start = State(nodes[rows, :n], nodes[rows, n : 2 * n], memory)
        forces = Forces(preceding.u[:, rows], np.empty((pieces, 0, len(rows), n)))
        with np.errstate(all="ignore"):
            end = ends(scene, start, forces, track.dt[rows], fine)
        memory = end.memory
        if friction.law.sample_time is not None:
            x = Inputs(end.q, end.w, preceding.u[-1][rows], 0.0 * end.q)
            memory = friction.law.advance(scene.friction.theta, x, memory, track.dt[rows, None])
        out.end[rows] = np.concatenate([end.q, end.w, *memory], axis=-1)
        out.by_start[rows] = end.by_start
    return out


def _moved(chain: Chain, nodes: Array, windows: Array, track: Track, sigma: Array) -> Array:
    """Nodes after a step of all windows, each on its own."""
    n = track.n
    first = windows[:, 0]
    precision = np.zeros((len(windows), 2 * n))
    precision[:, n:] = 1.0 / _START**2
    precision[:, :n] = 1e-6
    wanted = np.zeros_like(precision)
    wanted[:, n:] = track.w[first] - nodes[first, n : 2 * n]
    weight = np.ones_like(chain.error)
    for _ in range(2):
        normal = eliminated(chain, weight, sigma, np.stack([wanted, precision]))
        left = chain.error - (chain.slope @ normal.start[:, None, :, None])[..., 0]
        weight = np.minimum(1.0, _HUBER * sigma / np.maximum(np.abs(left), 1e-12))
    step = chain.moved + (chain.carried @ normal.start[:, None, :, None])[..., 0]
    on = windows >= 0
    out = nodes.copy()
    out[windows[on]] += step[on]
    # what got lost begins anew
    bad = ~(np.abs(out[:, :n] - track.before).max(axis=-1) < _LOST) | ~np.isfinite(out).all(-1)
    out[bad, : 2 * n] = np.concatenate([track.q, track.w], axis=-1)[bad]
    return out
