"""Single windows between two iterations: which count, which go back, and where nodes move.

Where a joint just misses or just reaches a standstill, the prediction has a kink in the initial
state, and steps of that window may fail again and again. It is damped, or left out, on its own.
"""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, huber_cost, picked

from ..parameter_block import Estimate
from .problem import ShootingProblem
from .windows import (
    AT_ONCE,
    START_VELOCITY,
    WindowPrediction,
    initial_state_prior,
    predict_windows,
)

_LOST = 0.5  # [rad]: nodes that leave the measured motion by more begin anew
_MOST = 4.0  # of Huber's threshold: windows further off are lost anyhow
_CLOSED, _OPEN = 0.1, 1.0  # [noise]: a typical gap when most have closed, and one that has not
_TORN = 10.0  # [noise]: a typical gap after a step that went too far
_HALF = 0.5  # of a lost window's cost: up to there a window counts fully
_FAR = 2.0  # [noise], and noise per sample: a long step of an initial state
_FEW = 0.15  # of the windows, which may be left out for good
_OFTEN = 3  # steps that failed
_SHUT = 0.05  # [noise]: smaller gaps do not matter


class Point(NamedTuple):
    """An estimate with nodes (K, s), and the windows' predictions linearised there.

    prior : (2, W, 2n), see `eliminate_states`
    gap : (W,), how far nodes are from their window's prediction [standard deviations of the noise]
    damping : (W,) of the step of a window's initial state; out : (W,) windows that do not count
    kinked : (W,) windows left out for good, as steps of their initial states fail again and again
    failures : (W,) how often such steps have failed since most gaps closed
    """

    estimate: Estimate
    nodes: Array
    windows: Array
    prediction: WindowPrediction
    prior: Array
    gap: Array
    damping: Array
    out: Array
    kinked: Array
    failures: Array


def linearised_at(
    problem: ShootingProblem, windows: Array, estimate: Estimate, nodes: Array, sigma: Array
) -> Point:
    """All windows (W, N), linearised at an estimate and nodes (K, s)."""
    intervals, n = problem.intervals, problem.intervals.n
    first = windows[:, 0]
    nodes = nodes.copy()
    memory = problem.initial_memory(estimate)
    if memory:
        nodes[first, 2 * n :] = np.concatenate(memory, axis=-1)[first]
    prediction = _predicted(problem, windows, estimate, nodes)
    weak = 1e-6 / np.maximum(1.0, np.abs(nodes[first, :n])) ** 2
    velocity = START_VELOCITY * intervals.dataset.scales.slow
    prior = initial_state_prior(intervals, nodes, first, weak, velocity)
    gap = (np.abs(prediction.moved[..., :n]) / sigma).max(axis=(1, 2))
    none = np.zeros(len(windows))
    return Point(estimate, nodes, windows, prediction, prior, gap, none, none > 0, none > 0, none)


@np.errstate(over="ignore", invalid="ignore")  # windows that diverge are left out
def _predicted(
    problem: ShootingProblem, windows: Array, estimate: Estimate, nodes: Array
) -> WindowPrediction:
    """Predictions of windows (W, N), linearised some at a time: many need little more room."""
    offset = estimate.calibration.offset

    def predicted(part: Array) -> WindowPrediction:
        linearised = problem.linearise(estimate, nodes, part[part >= 0])
        return predict_windows(problem.intervals, linearised, nodes, part, offset)

    count = -(-windows.size // AT_ONCE)
    if count == 1:
        return predicted(windows)
    out: WindowPrediction | None = None
    first = 0
    for part_windows in np.array_split(windows, count):
        part = predicted(part_windows)
        out = out or WindowPrediction(*(np.empty((len(windows), *x.shape[1:])) for x in part))
        for whole, values in zip(out, part, strict=True):
            whole[first : first + len(part_windows)] = values
        first += len(part_windows)
    assert out is not None
    return out


def cost_of(prediction: WindowPrediction, out: Array, sigma: Array, huber: float) -> float:
    """Cost of all windows but those left `out` (W,), tapered as `_taper` says."""
    lost = _lost_cost(prediction, huber)
    costs = _costs(prediction, sigma, huber)
    u, plain = _taper(costs, lost), np.minimum(costs, _HALF * lost)
    tapered = (1.0 - _HALF) * lost * (u - 2 * u**3 / 3 + u**5 / 5)
    return float((plain + tapered)[~out].sum())


def counts_of(point: Point, sigma: Array, huber: float) -> Array:
    """How much windows (W,) count once most gaps have closed; all that are not out before.

    The derivative of a window's tapered cost by its own one. It falls from one, at half the cost of
    a lost window, to zero there: no window jumps between counting and not counting.

        (1 - u^2)^2,    u = max(0, 2 cost / lost - 1)
    """
    if not _most_closed(point):
        return ~point.out * 1.0
    u = _taper(_costs(point.prediction, sigma, huber), _lost_cost(point.prediction, huber))
    return ~point.out * (1.0 - u**2) ** 2


def _most_closed(point: Point) -> bool:
    return bool(np.median(point.gap) < _CLOSED)


def opened(point: Point, last: Point) -> bool:
    """Whether a step tore predictions apart where most gaps had closed: it went too far.

    The cost, which is that of the linearisation, does not show it.
    """
    return _most_closed(last) and not np.median(point.gap) <= _TORN


def _taper(cost: Array, lost: Array) -> Array:
    """How far costs (W,) have gone from half that of a lost window, 0, to it, 1."""
    return np.clip((cost / np.maximum(lost, 1e-300) - _HALF) / (1.0 - _HALF), 0.0, 1.0)


def _costs(prediction: WindowPrediction, sigma: Array, huber: float) -> Array:
    """Huber's cost (W,) of predictions as they stand, none above that of a lost window."""
    rho = huber_cost(np.abs(prediction.error) / sigma, huber) * prediction.share[..., None]
    return np.minimum(rho.sum(axis=(1, 2)), _lost_cost(prediction, huber))


def _lost_cost(prediction: WindowPrediction, huber: float) -> Array:
    """Cost (W,) of windows that are lost."""
    return _MOST * huber**2 * prediction.share.sum(axis=1)


def with_windows_checked(
    point: Point, last: Point, move: Array, sigma: Array, huber: float, near: bool
) -> Point:
    """The point after a step, when most gaps have closed: windows that became worse go back.

    These, and windows whose gap stays open, make a smaller step next; one that is not continuous
    does not count meanwhile.
    """
    if not _most_closed(point):
        return point._replace(kinked=last.kinked, out=last.kinked, failures=last.failures)
    before, after = (_costs(x.prediction, sigma, huber) for x in (last, point))
    worse = ~(after < 1.3 * before + 2.0) & (last.gap < _OPEN)
    open_ = (point.gap > _SHUT) & (point.gap > 0.5 * last.gap)
    damping = np.where(worse | open_, np.maximum(10.0 * last.damping, 0.1), last.damping / 10.0)
    damping = np.where(damping < 0.01, 0.0, np.minimum(damping, 1e4))
    out = (damping > 0) & (point.gap > _OPEN) & ~worse
    failures = last.failures + (worse | (point.gap > _OPEN) & open_)
    kinked = last.kinked | (failures >= _OFTEN)
    if near:
        kinked |= worse | open_
    kinked = kinked if np.mean(kinked) < _FEW else last.kinked
    if worse.any():
        point = _with_windows_back(point, last, worse, move)
    return point._replace(damping=damping, out=out | kinked, kinked=kinked, failures=failures)


def _with_windows_back(point: Point, last: Point, which: Array, move: Array) -> Point:
    """The point with some windows as they were, but for the shared parameters' move since.

    Their predictions are written over: copies of all of them are gigabytes.
    """
    new, old = point.prediction, picked(last.prediction, which)
    size = old.slope.shape[-1] - len(move)
    new.error[which] = old.error - old.slope[..., size:] @ move
    new.moved[which] = old.moved + old.carried[..., size:] @ move
    new.slope[which], new.carried[which] = old.slope, old.carried
    at = point.windows[which]
    at = at[at >= 0]
    wanted = _replaced(point.prior[0], which, last.prior[0][which])
    return point._replace(
        nodes=_replaced(point.nodes, at, last.nodes[at]),
        prior=np.stack([wanted, point.prior[1]]),
        gap=_replaced(point.gap, which, last.gap[which]),
    )


def _replaced(values: Array, rows: Array, new: Array) -> Array:
    """A copy of the values with some rows replaced."""
    out = values.copy()
    out[rows] = new
    return out


def initial_state_damping(problem: ShootingProblem, point: Point, sigma: Array) -> Array:
    """Precision (W, 2n) that keeps the steps of the initial states small.

    A window's own information is worth more, unless a joint rests or a kink is near.
    """
    per_time = np.median(problem.intervals.dt) / sigma
    held = np.concatenate([1.0 / sigma, per_time]) / _FAR
    information = np.concatenate([1.0 / sigma, per_time * len(point.prediction.error[0])])
    return held**2 + point.damping[:, None] * information**2


def moved_nodes(problem: ShootingProblem, point: Point, moves: Array) -> Array:
    """Nodes (K, s) on the predictions of their windows; windows that got lost begin anew.

    moves : (W, 2n + D) of the initial states and the parameters
    """
    n, intervals, windows = problem.intervals.n, problem.intervals, point.windows
    prediction = point.prediction
    nodes = point.nodes.copy()
    step = prediction.moved + (prediction.carried @ moves[:, None, :, None])[..., 0]
    on = windows >= 0
    at = windows[on]
    nodes[at] += step[on]
    offset = point.estimate.calibration.offset
    off = np.abs(nodes[at, :n] - (intervals.before[at] - offset)).max(axis=-1)
    bad = ~(off < _LOST) | ~np.isfinite(nodes[at]).all(axis=-1)
    if bad.any():
        owner = np.repeat(np.arange(len(windows)), on.sum(axis=1))
        lost = np.isin(owner, np.unique(owner[bad]))
        nodes[at[lost]] = problem.initial_nodes(point.estimate)[at[lost]]
    return nodes
