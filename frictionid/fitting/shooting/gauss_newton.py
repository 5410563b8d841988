"""Gauss-Newton over all windows at once: initial states eliminated, Huber weights, damped steps.

Minimised over the free parameters p and the initial state of each window is

    sum over windows, samples, joints of  share huber((measured - predicted)/sigma)^2  + priors

in stages of growing window length. Each iteration linearises all intervals at their nodes, accepts
the step before it or takes it back, and solves the normal equations for the next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.box_qp import bounded
from frictionid.fitting.parameters.parameter_block import (
    Estimate,
    Parameter,
    values_of,
    with_values,
)
from frictionid.fitting.shooting.problem import ShootingProblem
from frictionid.fitting.shooting.sample_intervals import cut_windows
from frictionid.fitting.shooting.window_steps import (
    Point,
    cost_of,
    counts_of,
    initial_state_damping,
    linearised_at,
    moved_nodes,
    with_windows_checked,
)
from frictionid.fitting.shooting.windows import NormalEquations, eliminate_states
from frictionid.progress import report_step

_MAD = 1.4826  # standard deviation over median absolute deviation, of normal noise
_DAMPING = (1e-8, 1e4)
_WORSE = 1.02  # a cost that grows by more was a step too far
_ROUNDS = 3  # of Huber weights in an iteration
_LEAST_SHARE = 0.2  # of a Gauss-Newton step
_LEADING = 4  # iterations of the stages before the last
_CIRCLE = 8  # steps that may lead to and fro
_DAMPED = 1e-2  # Levenberg damping that makes steps small by itself
_NEAR = 0.5  # [standard errors]: steps with which those end
_COARSE = 3.0  # times as long are their substeps near rest
_TRACE = 1e-12  # of the information on the best known parameter


class Solution(NamedTuple):
    """Where a fit ended.

    estimate; nodes (K, s); windows (W, N); residual (W, N + 1, n) [rad] after the last step, share
    (W, N + 1) and weight of each; sigma (n,) [rad]; normal equations of the windows before the last
    step, as much as each counts, and that step, move (D,); free (D,), parameters that are not at a
    bound; counts (W,), how much windows count; kinked (W,), true for those that were left out as
    their predictions jump; converged, and the number of iterations.
    """

    estimate: Estimate
    nodes: Array
    windows: Array
    residual: Array
    share: Array
    weight: Array
    sigma: Array
    normal: NormalEquations
    move: Array
    free: Array
    counts: Array
    kinked: Array
    converged: bool = False
    iterations: int = 0

    @property
    def closed(self) -> Array:
        """True (W,) for windows that counted."""
        return self.counts > 0

    @property
    def curvature(self) -> Array:
        """Normal matrix (D, D) of the windows that counted, without priors."""
        return np.asarray(self.normal.H[self.closed].sum(axis=0))


@dataclass(frozen=True, eq=False)
class _Stage:
    """What does not change over the iterations of a stage: windows (W, N)."""

    problem: ShootingProblem
    windows: Array

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds (D,) of the parameters."""
        parameters = self.problem.parameters
        return np.array([p.low for p in parameters]), np.array([p.high for p in parameters])


class _Step(NamedTuple):
    """One iteration: the point of its linearisation, and the solution after its step.

    damping : Levenberg's; share : of the Gauss-Newton step that was taken; error : standard errors
    (D,) of the parameters, infinite of those whose moves do not matter
    """

    point: Point
    solution: Solution
    damping: float
    share: float
    error: Array

    @property
    def largest(self) -> float:
        """Largest move of a parameter in standard errors."""
        return float((np.abs(self.solution.move) / self.error).max(initial=0.0))

    def converged(self, tolerance: float) -> bool:
        """Whether it moved no parameter by more than a share of its standard error."""
        return bool(self.largest <= self.share * tolerance) and self.damping < _DAMPED


def solve(
    problem: ShootingProblem, estimate: Estimate, use: Array, ended: Solution | None = None
) -> Solution:
    """The free parameters for which predicted angles come closest to the measured ones.

    Parameters
    ----------
    problem, estimate : what is fitted, and where the fit begins
    use : (K,) true for the intervals that may be used
    ended : where a fit to the same intervals ended, with other parameters or windows: only the last
        stage is left then, from its states, and of the same windows without those that it left out
        for good; by default the fit begins with the smoothed motion
    """
    lengths, leading, solution = problem.settings.windows, _leading(problem), None
    stages = [(lengths[-1], problem)]
    if ended is None:
        nodes, sigma, total = problem.initial_nodes(estimate), _initial_noise(problem, use), 0
        stages = [(s, leading) for s in lengths] + stages
    else:
        nodes, sigma, total = ended.nodes, ended.sigma, ended.iterations
    for seconds, own in stages:
        windows = cut_windows(problem.intervals, use, seconds)
        kinked = ended.kinked if ended and np.array_equal(windows, ended.windows) else None
        solution = _solve_stage(_Stage(own, windows), estimate, nodes, sigma, kinked)
        total += solution.iterations
        estimate, nodes, sigma = solution.estimate, solution.nodes, solution.sigma
    assert solution is not None
    return solution._replace(iterations=total)


def move_with_windows(problem: ShootingProblem, solution: Solution, seconds: float) -> Array:
    """What a Gauss-Newton step with windows of another length would change in the parameters (D,).

    Only in intervals of windows that counted.
    """
    windows = solution.windows[solution.closed]
    use = np.zeros(len(problem.intervals.dt), dtype=bool)
    use[windows[windows >= 0]] = True
    stage = _Stage(problem, cut_windows(problem.intervals, use, seconds))
    estimate, nodes, sigma = solution.estimate, solution.nodes, solution.sigma
    point = linearised_at(problem, stage.windows, estimate, nodes, sigma)
    return _next_step(stage, point, sigma, _DAMPING[0], 1.0).solution.move


def _leading(problem: ShootingProblem) -> ShootingProblem:
    """The problem with looser settings, for the stages before the last one."""
    s = problem.settings
    few, near = min(s.iterations, _LEADING), max(s.tolerance, _NEAR)
    settings = replace(s, iterations=few, tolerance=near, fine=_COARSE * s.fine)
    return replace(problem, settings=settings)


def _initial_noise(problem: ShootingProblem, use: Array) -> Array:
    """First estimate of the angle noise (n,) [rad]: what the smoother took off."""
    intervals = problem.intervals
    off = np.abs(intervals.before - intervals.q)[use]
    floor = 1e-9 + 1e-6 * np.abs(intervals.before).max(axis=0)
    return np.maximum(_MAD * np.median(off, axis=0), floor)


def _solve_stage(
    stage: _Stage, estimate: Estimate, nodes: Array, sigma: Array, kinked: Array | None
) -> Solution:
    """Gauss-Newton iterations over windows of one length; (W,) that are left out from the start."""
    settings = stage.problem.settings
    point = linearised_at(stage.problem, stage.windows, estimate, nodes, sigma)
    if kinked is not None:
        point = point._replace(kinked=kinked, out=kinked)
    step, before = _next_step(stage, point, sigma, _DAMPING[0], 1.0), None
    path, what = [_begin(stage, step)], f"windows of {stage.windows.shape[1]} samples"
    report_step(what, settings.iterations - 1)
    while len(path) < settings.iterations and not _converged(stage, step, path):
        point, damping = _accepted_or_last(stage, step)
        share = _step_share(step, before)
        before = step.solution.move
        step = _next_step(stage, point, step.solution.sigma, damping, share)
        path.append(_begin(stage, step))
        report_step(what, settings.iterations - len(path))
    converged = _converged(stage, step, path)
    return step.solution._replace(converged=converged, iterations=len(path))


class _Begin(NamedTuple):
    """All that is kept of a step that is over: its damping, and the values (D,) it began at."""

    damping: float
    values: Array


def _begin(stage: _Stage, step: _Step) -> _Begin:
    return _Begin(step.damping, values_of(step.point.estimate, stage.problem.blocks))


def _converged(stage: _Stage, last: _Step, path: Sequence[_Begin]) -> bool:
    """Whether the last step was small, or the last few led to and fro and nowhere.

    Where the cost has a kink (a joint that just stops in some window), steps from either side of it
    point to the other one and never become small. The solution is the kink: over the last steps
    none of the parameters got on by more than the tolerance, nor left by more than half a standard
    error.
    """
    tolerance = stage.problem.settings.tolerance
    if last.converged(tolerance):
        return True
    few = path[-_CIRCLE:]
    if len(few) < _CIRCLE or any(begin.damping >= _DAMPED for begin in few):
        return False
    end = values_of(last.solution.estimate, stage.problem.blocks)
    way = np.stack([*(begin.values for begin in few), end]) / last.error
    onward = np.abs(way[-1] - way[0]).max(initial=0.0)
    return bool(onward <= tolerance and np.ptp(way, axis=0).max(initial=0.0) <= _NEAR)


def _accepted_or_last(stage: _Stage, step: _Step) -> tuple[Point, float]:
    """The point that a step led to, less damping; or the point before it again, more damping.

    A step is taken back where the cost has grown.
    """
    s, last = step.solution, step.point
    huber = stage.problem.settings.huber
    point = linearised_at(stage.problem, stage.windows, s.estimate, s.nodes, s.sigma)
    near = step.largest <= step.share * _NEAR
    point = with_windows_checked(point, last, s.move, s.sigma, huber, near)
    before, after = (cost_of(x.prediction, point.out, s.sigma, huber) for x in (last, point))
    if after > _WORSE * before and step.damping < _DAMPING[1]:
        return last, max(step.damping, 1e-4) * 10.0
    return point, max(step.damping / 10.0, _DAMPING[0])


def _step_share(step: _Step, before: Array | None) -> float:
    """Share of the next Gauss-Newton step. Oscillating steps are damped.

    Windows with kinks may push now one way, now the other: the share halves where the last two
    moves a, b point against each other in the metric of the normal matrix, -a H b > 0.3 |a| |b|.
    """
    if before is None:
        return step.share
    H, a, b = step.solution.curvature, before, step.solution.move
    against = -float(a @ H @ b)
    size = np.sqrt(max(float(a @ H @ a) * float(b @ H @ b), 0.0))
    if against > 0.3 * size:
        return max(0.5 * step.share, _LEAST_SHARE)
    return min(1.0, 1.5 * step.share)


class _Round(NamedTuple):
    """Solution of the normal equations under some Huber weights, and the next weights.

    H (D, D) : normal matrix with priors; move (D,); moves (W, 2n + D) : of each window's initial
    state, and `move`
    """

    normal: NormalEquations
    H: Array
    move: Array
    moves: Array
    residual: Array
    sigma: Array
    weight: Array


def _next_step(stage: _Stage, point: Point, sigma: Array, damping: float, share: float) -> _Step:
    """The step from a linearised point, by least squares reweighted a few times."""
    weight = np.ones_like(point.prediction.error)
    slow = initial_state_damping(stage.problem, point, sigma)
    counts = counts_of(point, sigma, stage.problem.settings.huber)
    for _ in range(_ROUNDS):
        normal = eliminate_states(point.prediction, weight, sigma, point.prior, slow)
        normal = normal.weighted(counts)
        one = _solved(stage, point, normal, sigma, (damping, share))
        weight, sigma = one.weight, one.sigma
    wanted = values_of(point.estimate, stage.problem.blocks) + one.move
    low, high = stage.bounds
    free = (wanted > low + 1e-12) & (wanted < high - 1e-12)
    solution = Solution(
        estimate=with_values(point.estimate, stage.problem.blocks, wanted),
        nodes=moved_nodes(stage.problem, point, one.moves),
        windows=stage.windows,
        residual=one.residual,
        share=point.prediction.share,
        weight=one.weight,
        sigma=one.sigma,
        normal=one.normal,
        move=one.move,
        free=free,
        counts=counts,
        kinked=point.kinked,
    )
    return _Step(
        point,
        solution,
        damping,
        share,
        _errors(one, free, stage.problem.prior_precision),
    )


def _solved(
    stage: _Stage, point: Point, normal: NormalEquations, sigma: Array, control: tuple[float, float]
) -> _Round:
    """Solve the normal equations of all windows: H move = g, within bounds.

    H = sum H_w + diag(1/prior^2),    g = sum g_w + (mean - value)/prior^2

    control : Levenberg damping, and the share of the Gauss-Newton step
    """
    prediction, value = point.prediction, values_of(point.estimate, stage.problem.blocks)
    precision, (low, high) = stage.problem.prior_precision, stage.bounds
    damping, share = control
    H = normal.H.sum(axis=0) + np.diag(precision)
    g = normal.g.sum(axis=0) + precision * (stage.problem.prior_mean - value)
    damped = H + _missing_information(H, stage.problem.parameters)
    move = share * _bounded_step(damped, g, low - value, high - value, damping)
    start = normal.start - normal.to_start @ move
    moves = np.concatenate([start, np.broadcast_to(move, (len(start), len(move)))], axis=1)
    residual = prediction.error - (prediction.slope @ moves[:, None, :, None])[..., 0]
    sigma = _noise(residual, prediction.share, normal.leverage, sigma)
    size = np.abs(residual) / sigma
    weight = np.minimum(1.0, stage.problem.settings.huber / np.maximum(size, 1e-12))
    return _Round(normal, H, move, moves, residual, sigma, weight)


def _missing_information(H: Array, parameters: Sequence[Parameter]) -> Array:
    """What H (D, D) lacks on its diagonal, so that parameters without a trace do not run away.

    Each should have a trillionth of the information on the best known one of its block and unit.
    """
    own = np.diag(H)
    kinds = [(p.block, p.unit) for p in parameters]
    most = {k: max(own[i] for i, kind in enumerate(kinds) if kind == k) for k in set(kinds)}
    return np.diag(np.maximum([_TRACE * most[kind] for kind in kinds] - own, 0.0))


def _bounded_step(H: Array, g: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped step within bounds, in units in which the diagonal of H is one."""
    if not len(g):
        return g
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    scaled = H / np.outer(scale, scale) + damping * np.eye(len(g))
    inner = bounded(scaled[None], (g / scale)[None], (low * scale)[None], (high * scale)[None])
    return inner[0] / scale


def _noise(residual: Array, share: Array, leverage: Array, sigma: Array) -> Array:
    """Angle noise (n,) [rad] from the residuals, each corrected for its leverage."""
    known = share > 0
    clean = residual / np.sqrt(np.maximum(1.0 - leverage, 0.05))
    return np.maximum(_MAD * np.median(np.abs(clean[known]), axis=0), 1e-3 * sigma)


def _errors(one: _Round, free: Array, precision: Array) -> Array:
    """Standard errors (D,) by which moves are judged.

    Infinite for parameters that are at a bound or leave no trace, and larger where a part of the
    information comes from a prior. They are those by the curvature, or by the scatter between
    windows where that is larger: what a model does not explain is an error that the samples of a
    window share.

        H^-1 (sum_w s_w s_w') H^-1,    s_w = g_w - H_w move
    """
    own = one.H[np.ix_(free, free)]
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    inverse = np.linalg.pinv(own / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    score = (one.normal.g - one.normal.H @ one.move)[:, free] @ inverse
    variance = np.diag(inverse)
    by_data = np.clip(1.0 - precision[free] * variance, 0.0, 1.0)
    known = (variance > 0.0) & (by_data > 0.0)
    scatter = np.einsum("wd,wd->d", score, score)
    error = np.full(len(free), np.inf)
    error[np.flatnonzero(free)[known]] = np.sqrt(
        np.maximum(variance, scatter)[known] / by_data[known]
    )
    return error
