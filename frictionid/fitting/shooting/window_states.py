"""Shooting with all parameters fixed: only the motion over each window is fitted to its angles."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, huber_weight
from frictionid.dynamics.end_states import end_states
from frictionid.dynamics.law_derivatives import FreeTheta, reads_of
from frictionid.dynamics.state import State, state_of
from frictionid.dynamics.step_size import halved, step_size_of
from frictionid.dynamics.tangent import MotionModel, MotorTorque
from frictionid.friction import Friction, Inputs, Memory
from frictionid.friction.coordinates import at_places
from frictionid.friction.wrapped import held
from frictionid.mechanics import Plant

from .problem import Linearisation
from .sample_intervals import Intervals
from .windows import (
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
    feedback : (K, 2, n) of servos, see `Plant.feedback`; None without
    """

    intervals: Intervals
    windows: Array
    u: Array
    sigma: Array
    feedback: Array | None = None

    @property
    def owner(self) -> Array:
        """Window (K,) of each interval."""
        return np.repeat(np.arange(len(self.windows)), (self.windows >= 0).sum(axis=1))

    def take(self, rows: Array) -> "SampleWindows":
        """Some (k,) of the windows, as often as they are asked for."""
        chosen = self.windows[rows]
        index = chosen[chosen >= 0]
        windows = np.full(chosen.shape, -1)
        windows[chosen >= 0] = np.arange(len(index))
        intervals = self.intervals.take(index)
        loop = None if self.feedback is None else self.feedback[index]
        return SampleWindows(intervals, windows, self.u[:, index], self.sigma, loop)

    def with_rows(self, other: "SampleWindows", rows: Array) -> "SampleWindows":
        """The windows with some (K,) rows of another calibration of the same data."""
        new = {}
        for name in ("before", "after", "q", "w"):
            new[name] = getattr(self.intervals, name).copy()
            new[name][rows] = getattr(other.intervals, name)[rows]
        u = self.u.copy()
        u[:, rows] = other.u[:, rows]
        loop = None if self.feedback is None else self.feedback.copy()
        if loop is not None and other.feedback is not None:
            loop[rows] = other.feedback[rows]
        return self._replace(intervals=replace(self.intervals, **new), u=u, feedback=loop)


def _initial_nodes(samples: SampleWindows, friction: Friction) -> Array:
    """Nodes (K, s): the smoothed states; memories begin anew in each, but those of samples."""
    q, w = samples.intervals.q, samples.intervals.w
    nodes = np.concatenate([q, w], axis=-1)
    if friction.law.sample_time is not None:
        return nodes
    x = _inputs(samples, nodes, samples.u[0])
    memory = friction.law.start(friction.theta[samples.owner], x)
    return np.concatenate([nodes, *(np.broadcast_to(z, x.q.shape) for z in memory)], axis=-1)


def _inputs(samples: SampleWindows, nodes: Array, u: Array) -> Inputs:
    """What friction sees of states (K, s) under motor torques (K, n)."""
    q, w = np.split(nodes[:, : 2 * samples.intervals.n], 2, axis=-1)
    return at_places(samples.intervals.dataset.mechanism, Inputs(q, w, u, 0.0 * q))


def _between_samples(
    samples: SampleWindows, friction: Friction, nodes: Array
) -> tuple[Friction, Memory]:
    """Friction without memory (K, m, P) in each interval, and memory (S, m) in windows' last ones.

    A memory of samples stands still between them. It takes in the samples at the nodes (K, s), one
    after the other, and so needs no node of its own.
    """
    law, windows, dt = friction.law, samples.windows, samples.intervals.dt
    theta = memory = None
    for k in range(windows.shape[1]):
        rows = np.flatnonzero(windows[:, k] >= 0)
        theta_here = friction.theta if len(rows) == len(windows) else friction.theta[rows]
        at, before = windows[rows, k], windows[rows, max(k - 1, 0)]
        if theta is None or memory is None:
            x = _inputs(samples, nodes[at], samples.u[0][at])
            here = law.start(theta_here, x)
            memory = tuple(np.zeros((len(windows), x.w.shape[-1])) for _ in here)
        else:
            x = _inputs(samples, nodes[at], samples.u[-1][before])
            here = law.advance(theta_here, x, tuple(z[rows] for z in memory), dt[before, None])
        for whole, entry in zip(memory, here, strict=True):
            whole[rows] = entry
        still, numbers = held(law, theta_here, tuple(z[rows] for z in memory))
        if theta is None:
            theta = np.empty((len(nodes), *numbers.shape[1:]))
        theta[at] = numbers
    assert theta is not None and memory is not None
    return replace(friction, law=still, theta=theta, calibration=None, constraints=None), memory


def _linearised(
    samples: SampleWindows, plant: Plant, friction: Friction, nodes: Array
) -> Linearisation:
    """End states of all intervals from nodes (K, s), and their derivatives by these."""
    intervals, u, n, K = samples.intervals, samples.u, samples.intervals.n, len(nodes)
    owner, first = samples.owner, np.arange(min(64, K))
    part = float(intervals.dt.max()) / len(u)
    step_size_of(plant, friction, part)  # refuses laws that no step resolves
    place = owner  # of each interval's own friction
    if friction.law.sample_time is not None:
        friction, place = _between_samples(samples, friction, nodes)[0], np.arange(K)
    x = _inputs(samples, nodes[first], u[0][first])
    reads = reads_of(friction.law, friction.theta[place[first]], x)
    parts = halved(part / _FINE)
    out, motion = Linearisation.zeros(nodes, np.zeros((0, n))), intervals.base_motion
    for rows in np.array_split(np.arange(K), max(1, -(-K // _ROWS))):
        loop = None if samples.feedback is None else samples.feedback[rows]
        here = replace(plant[owner[rows]], feedback=loop)
        here = here.on_base(None if motion is None else motion[rows])
        model = MotionModel(here, friction[place[rows]], _NO_PARAMETER, (), reads)
        torque, by = u[:, rows], np.empty((len(u), 0, len(rows), n))
        motor = MotorTorque(torque, by, 0.0 * torque, by)
        with np.errstate(all="ignore"):
            end = end_states(model, nodes[rows], motor, intervals.dt[rows], parts)
        out.end[rows], out.by_start[rows] = end
    return out


def solve_states(samples: SampleWindows, plant: Plant, friction: Friction) -> tuple[State, Array]:
    """The motion over each window that comes closest to its angles, by Gauss-Newton.

    Parameters
    ----------
    samples : S windows; plant, friction : with one entry for each window

    Returns
    -------
    states (W, n) at the ends of the W windows that have an interval, and how far [rad] nodes are
    from the prediction of their own window, (W,)
    """
    used = rows = np.flatnonzero(samples.windows[:, 0] >= 0)
    nodes = _initial_nodes(samples, friction)
    linearised = _linearised(samples, plant, friction, nodes)
    windows = moving = samples.windows[rows]
    for _ in range(_ROUNDS):
        with np.errstate(all="ignore"):
            moved, still = _moved(samples, linearised, nodes, moving)
            rows, moving = rows[~still], moving[~still]
            if not len(rows):
                break
            moved_rows = moving[moving >= 0]
            nodes[moved_rows] = moved[moved_rows]
            part = _linearised(samples.take(rows), plant[rows], friction[rows], nodes[moved_rows])
        linearised.end[moved_rows], linearised.by_start[moved_rows] = part.end, part.by_start
    n = samples.intervals.n
    prediction = predict_windows(samples.intervals, linearised, nodes, windows, np.zeros(n))
    gap = np.abs(prediction.moved[..., :n]).max(axis=(1, 2))
    return _last_states(samples, friction, nodes, linearised.end, used), gap


def _last_states(
    samples: SampleWindows, friction: Friction, nodes: Array, end: Array, used: Array
) -> State:
    """States at the ends of windows, `known` (W,), of the ends (K, s) of intervals from nodes."""
    law, last = friction.law, samples.windows[used].max(axis=1)
    state = state_of(end[last], samples.intervals.dataset.mechanism)
    if law.sample_time is None:
        return state
    memory = tuple(z[used] for z in _between_samples(samples, friction, nodes)[1])
    x = _inputs(samples, end[last], samples.u[-1][last])
    dt = samples.intervals.dt[last, None]
    return state._replace(memory=law.advance(friction.theta[used], x, memory, dt))


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
        weight = huber_weight(np.abs(left), _HUBER * sigma)
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
