"""Initial states by the model itself: from the samples up to the start, with its own physics.

A kinematic filter estimates a velocity from the last few angles alone; a model also uses its
physics. Over the last samples before each start the predicted motion is fitted to the measured
angles by shooting, with the state at their first sample free; where it ends, the rollout starts.
The estimate is causal, and made in the same way for all models.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import States
from frictionid.dynamics.state import State
from frictionid.evaluation.initial_states import InitialStates
from frictionid.fitting.shooting import SampleWindows, intervals_of, logged_torque, solve_states
from frictionid.friction import Friction, Inputs
from frictionid.friction.coordinates import at_places
from frictionid.mechanics import Plant

SAMPLES = 20
_PIECE = 0.009  # [s] of the physics step away from rest
_LOST = 0.3  # [rad]


def preceding_samples(
    dataset: Dataset, states: Sequence[States], initial: InitialStates
) -> SampleWindows:
    """Up to 20 samples before each initial state, with filtered states (`KalmanFilter`)."""
    intervals = intervals_of(dataset, states=tuple(states))
    sizes = np.array([len(s.time) for s in states])
    place = np.full(int(sizes.sum()), -1)
    first = np.concatenate([[0], np.cumsum(sizes)])
    place[first[intervals.recording] + intervals.index] = np.arange(len(intervals.time))
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
    part = intervals.take(index)
    pieces = int(np.ceil(float(np.median(part.dt)) / _PIECE - 1e-6))
    share = np.arange(max(pieces, 1) + 1) / max(pieces, 1)
    u = logged_torque(part, Calibration.ideal(intervals.n), np.arange(len(index)), share).mean
    driven = np.array([np.any(r.torque.value, axis=0) for r in dataset.recordings]).any(axis=0)
    sigma = 1.4826 * np.median(np.abs(intervals.before - intervals.q), axis=0)
    return SampleWindows(part, windows, u * driven, np.maximum(sigma, 1e-6))


def estimate_initial_states(
    plant: Plant, friction: Friction, preceding: SampleWindows, initial: InitialStates
) -> State:
    """Initial states (S, n), with memory, of frictions (S, n, P) on plants with one entry each.

    Where a model finds no motion that leads to the initial state, that of the filter stands.
    """
    intervals = preceding.intervals
    end, gap = solve_states(preceding, plant, friction)
    known = preceding.windows[:, 0] >= 0
    last = preceding.windows[known].max(axis=1)
    near = np.abs(end.q - intervals.after[last]).max(axis=-1) < _LOST
    near &= gap < 10.0 * preceding.sigma.max()
    for entry in (end.q, end.w, *end.memory):
        near &= np.isfinite(entry).all(-1)
    state = State(initial.q.copy(), initial.w.copy(), _memory(plant, friction, initial))
    good = np.flatnonzero(known)[near]
    pairs = zip((state.q, state.w, *state.memory), (end.q, end.w, *end.memory), strict=True)
    for whole, entry in pairs:
        whole[good] = entry[near]
    return state


def _memory(plant: Plant, friction: Friction, initial: InitialStates) -> tuple[Array, ...]:
    zero = 0.0 * initial.q
    x = at_places(plant.mechanism, Inputs(initial.q, initial.w, zero, zero))
    first = friction.law.start(friction.theta, x)
    return tuple(np.array(np.broadcast_to(z, x.q.shape)) for z in first)
