"""Shooting with all parameters fixed: only the motion over each window is fitted to its angles."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import step_size_of
from frictionid.friction import Friction, Inputs
from frictionid.friction.coordinates import at_places
from frictionid.mechanics import Plant
from frictionid.shooting.law_derivatives import FreeTheta, reads_of
from frictionid.shooting.motor_torque import MotorTorque
from frictionid.shooting.problem import Linearisation, memory_of
from frictionid.shooting.sample_intervals import Intervals
from frictionid.shooting.sensitivities import end_states
from frictionid.shooting.tangent import MotionModel
from frictionid.shooting.windows import (
    START_VELOCITY,
    eliminate_states,
    initial_state_prior,
    predict_windows,
)

_ROUNDS = 6
_STILL = 1e-3  # of the noise, and of the slow velocity: a window whose nodes move less is solved
_HUBER = 2.5  # [noise]
_ROWS = 4000  # intervals at a time, for the cache's sake
_FINE = 0.0007  # [s] of the physics step near rest
_ANGLE = 1e-6  # precision of an initial angle: next to nothing
_LOST = 0.3  # times the size of a joint

_NO_PARAMETER = FreeTheta(np.zeros(0, int), np.zeros(0, int))


class SampleWindows(NamedTuple):
    """S windows of intervals, each with its own copy of them, one after the other.

    intervals : K of them; windows (S, N), their indices, -1 behind a window's end
    u : (pieces, K, n) [N m]; sigma : (n,) [rad], noise of the angles
    """

    intervals: Intervals
    windows: Array
    u: Array
    sigma: Array

    @property
    def owner(self) -> Array:
        """Window (K,) of each interval."""
        return np.repeat(np.arange(len(self.windows)), (self.windows >= 0).sum(axis=1))

    def take(self, rows: Array) -> SampleWindows:
        """Some (k,) of the windows, as often as they are asked for."""
        chosen = self.windows[rows]
        index = chosen[chosen >= 0]
        windows = np.full(chosen.shape, -1)
        windows[chosen >= 0] = np.arange(len(index))
        intervals = self.intervals.take(index)
        return self._replace(intervals=intervals, windows=windows, u=self.u[:, index])

    def with_rows(self, other: SampleWindows, rows: Array) -> SampleWindows:
        """The windows with some (K,) rows of another calibration of the same data."""
        new = {}
        for name in ("before", "after", "q", "w"):
            new[name] = getattr(self.intervals, name).copy()
            new[name][rows] = getattr(other.intervals, name)[rows]
        u = self.u.copy()
        u[:, rows] = other.u[:, rows]
        return self._replace(intervals=replace(self.intervals, **new), u=u)


def _initial_nodes(samples: SampleWindows, friction: Friction) -> Array:
    """Nodes (K, s): the smoothed states; memories begin anew in each."""
    q, w = samples.intervals.q, samples.intervals.w
    mechanism = samples.intervals.dataset.mechanism
    x = at_places(mechanism, Inputs(q, w, samples.u[0], 0.0 * q))
    memory = friction.law.start(friction.theta[samples.owner], x)
    return np.concatenate([q, w, *(np.broadcast_to(z, x.q.shape) for z in memory)], axis=-1)


def _linearised(
    samples: SampleWindows, plant: Plant, friction: Friction, nodes: Array
) -> Linearisation:
    """End states of all intervals from nodes (K, s), and their derivatives by these."""
    intervals, u, n, K = samples.intervals, samples.u, samples.intervals.n, len(nodes)
    owner, law, some = samples.owner, friction.law, slice(0, 64)
    mechanism = plant.mechanism
    q, w = intervals.q[some], intervals.w[some]
    x = at_places(mechanism, Inputs(q, w, u[0][some], 0.0 * q))
    reads = reads_of(law, friction.theta[owner[some]], x)
    part = float(intervals.dt.max()) / len(u)
    step_size_of(plant, friction, part)  # refuses laws that no step resolves
    fine = max(1, int(np.ceil(part / _FINE)))
    out = Linearisation.zeros(nodes, np.zeros((0, n)))
    for rows in np.array_split(np.arange(K), max(1, -(-K // _ROWS))):
        model = MotionModel(plant[owner[rows]], friction[owner[rows]], _NO_PARAMETER, (), reads)
        memory = memory_of(nodes[rows], mechanism)
        start = State(nodes[rows, :n], nodes[rows, n : 2 * n], memory)
        motor = MotorTorque(u[:, rows], np.empty((len(u), 0, len(rows), n)))
        with np.errstate(all="ignore"):
            end = end_states(model, start, motor, intervals.dt[rows], fine)
        memory = end.memory
        if law.sample_time is not None:
            x = at_places(mechanism, Inputs(end.q, end.w, u[-1][rows], 0.0 * end.q))
            memory = law.advance(model.friction.theta, x, memory, intervals.dt[rows, None])
        out.end[rows] = np.concatenate([end.q, end.w, *memory], axis=-1)
        out.by_start[rows] = end.by_start
    return out


def solve_states(
    samples: SampleWindows, plant: Plant, friction: Friction
) -> tuple[Linearisation, Array]:
    """The motion over each window that comes closest to its angles, by Gauss-Newton.

    Parameters
    ----------
    samples : S windows; plant, friction : with one entry for each window

    Returns
    -------
    the intervals linearised at the solution, and how far [rad] nodes are from the prediction of
    their own window, for each window that has an interval
    """
    rows = np.flatnonzero(samples.windows[:, 0] >= 0)
    nodes = _initial_nodes(samples, friction)
    linearised = _linearised(samples, plant, friction, nodes)
    windows = moving = samples.windows[rows]
    for _ in range(_ROUNDS):
        with np.errstate(all="ignore"):
            moved, still = _moved(samples, linearised, nodes, moving)
            rows, moving = rows[~still], moving[~still]
            if not len(rows):
                break
            some = moving[moving >= 0]
            nodes[some] = moved[some]
            own = _linearised(samples.take(rows), plant[rows], friction[rows], nodes[some])
        linearised.end[some], linearised.by_start[some] = own.end, own.by_start
    n = samples.intervals.n
    prediction = predict_windows(samples.intervals, linearised, nodes, windows, np.zeros(n))
    return linearised, np.abs(prediction.moved[..., :n]).max(axis=(1, 2))


def _moved(
    samples: SampleWindows, linearised: Linearisation, nodes: Array, windows: Array
) -> tuple[Array, Array]:
    """Nodes after a step of each window (W,) on its own, and which windows stay where they are.

    Nodes that got lost begin anew.
    """
    intervals, sigma, n = samples.intervals, samples.sigma, samples.intervals.n
    prediction = predict_windows(intervals, linearised, nodes, windows, np.zeros(n))
    scales = intervals.dataset.scales
    velocity = START_VELOCITY * scales.slow
    prior = initial_state_prior(intervals, nodes, windows[:, 0], _ANGLE, velocity)
    weight = np.ones_like(prediction.error)
    for _ in range(2):
        start = eliminate_states(prediction, weight, sigma, prior).start[:, None, :, None]
        left = prediction.error - (prediction.slope @ start)[..., 0]
        weight = np.minimum(1.0, _HUBER * sigma / np.maximum(np.abs(left), 1e-12))
    step = prediction.moved + (prediction.carried @ start)[..., 0]
    on = windows >= 0
    still = (np.abs(step[..., :n]) < _STILL * sigma).all(axis=(1, 2))
    still &= (np.abs(step[..., n : 2 * n]) < _STILL * scales.slow).all(axis=(1, 2))
    out = nodes.copy()
    out[windows[on]] += step[on]
    off = np.abs(out[:, :n] - intervals.before) / scales.size
    lost = ~(off.max(axis=-1) < _LOST)
    lost |= ~np.isfinite(out).all(-1)
    out[lost, : 2 * n] = np.concatenate([intervals.q, intervals.w], axis=-1)[lost]
    return out, still
