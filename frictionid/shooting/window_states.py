"""Shooting with all parameters fixed: only the motion over each window is fitted to its angles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import step_size_of
from frictionid.friction import Friction, Inputs
from frictionid.mechanics import Plant
from frictionid.shooting.intervals import Intervals
from frictionid.shooting.law_derivatives import FreeTheta, LawReads, reads_of
from frictionid.shooting.problem import Linearisation
from frictionid.shooting.sensitivities import MotorTorque, end_states
from frictionid.shooting.tangent import MotionModel
from frictionid.shooting.windows import eliminate_states, initial_state_prior, predict_windows

_ROUNDS = 6
_HUBER = 2.5  # [noise]
_ROWS = 4000  # intervals at a time, for the cache's sake
_FINE = 0.0007  # [s] of the physics step near rest
_VELOCITY = 1.0  # [rad/s], standard deviation of how far a velocity is from the smoothed one
_ANGLE = 1e-6  # precision of an initial angle: next to nothing
_LOST = 0.3  # [rad]

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

    def with_rows(self, other: SampleWindows, rows: Array) -> SampleWindows:
        """The windows with some (K,) rows of another calibration of the same data."""
        new = {}
        for name in ("before", "after", "q", "w"):
            new[name] = getattr(self.intervals, name).copy()
            new[name][rows] = getattr(other.intervals, name)[rows]
        u = self.u.copy()
        u[:, rows] = other.u[:, rows]
        return self._replace(intervals=replace(self.intervals, **new), u=u)


@dataclass(frozen=True, eq=False)
class _Problem:
    """The states of windows, with one plant and one friction for each window."""

    samples: SampleWindows
    plant: Plant
    friction: Friction

    @property
    def intervals(self) -> Intervals:
        return self.samples.intervals

    @cached_property
    def owner(self) -> Array:
        return self.samples.owner

    def initial_nodes(self) -> Array:
        """Nodes (K, s): the smoothed states; memories begin anew in each."""
        intervals = self.intervals
        q, w = intervals.q, intervals.w
        x = Inputs(q, w, self.samples.u[0], 0.0 * q)
        memory = self.friction.law.start(self.friction.theta[self.owner], x)
        return np.concatenate([q, w, *(np.broadcast_to(z, q.shape) for z in memory)], axis=-1)

    def linearise(self, nodes: Array) -> Linearisation:
        """End states of all intervals from nodes (K, s), and their derivatives by these."""
        part = float(self.intervals.dt.max()) / len(self.samples.u)
        step_size_of(self.plant, self.friction, part)  # refuses laws that no step resolves
        fine, reads = max(1, int(np.ceil(part / _FINE))), self._reads()
        out = Linearisation.zeros(nodes, np.zeros((0, self.intervals.n)))
        K = len(nodes)
        for rows in np.array_split(np.arange(K), max(1, -(-K // _ROWS))):
            out.end[rows], out.by_start[rows] = self._end_states(nodes[rows], rows, fine, reads)
        return out

    def _reads(self) -> LawReads:
        some = slice(0, 64)
        q, w, u = self.intervals.q[some], self.intervals.w[some], self.samples.u[0][some]
        theta = self.friction.theta[self.owner[some]]
        return reads_of(self.friction.law, theta, Inputs(q, w, u, 0.0 * q))

    def _end_states(
        self, nodes: Array, rows: Array, fine: int, reads: LawReads
    ) -> tuple[Array, Array]:
        n, owner, dt = self.intervals.n, self.owner[rows], self.intervals.dt[rows]
        model = MotionModel(self.plant[owner], self.friction[owner], _NO_PARAMETER, (), reads)
        memory = tuple(nodes[:, i : i + n] for i in range(2 * n, nodes.shape[1], n))
        start = State(nodes[:, :n], nodes[:, n : 2 * n], memory)
        motor = MotorTorque(
            self.samples.u[:, rows], np.empty((len(self.samples.u), 0, len(rows), n))
        )
        with np.errstate(all="ignore"):
            end = end_states(model, start, motor, dt, fine)
        memory, law = end.memory, self.friction.law
        if law.sample_time is not None:
            x = Inputs(end.q, end.w, self.samples.u[-1][rows], 0.0 * end.q)
            memory = law.advance(model.friction.theta, x, memory, dt[:, None])
        return np.concatenate([end.q, end.w, *memory], axis=-1), end.by_start


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
    problem = _Problem(samples, plant, friction)
    windows = samples.windows[samples.windows[:, 0] >= 0]
    nodes = problem.initial_nodes()
    linearised = problem.linearise(nodes)
    for _ in range(_ROUNDS):
        with np.errstate(all="ignore"):
            nodes = _moved(samples, linearised, nodes, windows)
            linearised = problem.linearise(nodes)
    n = samples.intervals.n
    prediction = predict_windows(samples.intervals, linearised, nodes, windows, np.zeros(n))
    return linearised, np.abs(prediction.moved[..., :n]).max(axis=(1, 2))


def _moved(
    samples: SampleWindows, linearised: Linearisation, nodes: Array, windows: Array
) -> Array:
    """Nodes after a step of each window on its own; those that got lost begin anew."""
    intervals, sigma, n = samples.intervals, samples.sigma, samples.intervals.n
    prediction = predict_windows(intervals, linearised, nodes, windows, np.zeros(n))
    prior = initial_state_prior(intervals, nodes, windows[:, 0], _ANGLE, _VELOCITY)
    weight = np.ones_like(prediction.error)
    for _ in range(2):
        start = eliminate_states(prediction, weight, sigma, prior).start[:, None, :, None]
        left = prediction.error - (prediction.slope @ start)[..., 0]
        weight = np.minimum(1.0, _HUBER * sigma / np.maximum(np.abs(left), 1e-12))
    step = prediction.moved + (prediction.carried @ start)[..., 0]
    on = windows >= 0
    out = nodes.copy()
    out[windows[on]] += step[on]
    lost = ~(np.abs(out[:, :n] - intervals.before).max(axis=-1) < _LOST)
    lost |= ~np.isfinite(out).all(-1)
    out[lost, : 2 * n] = np.concatenate([intervals.q, intervals.w], axis=-1)[lost]
    return out
