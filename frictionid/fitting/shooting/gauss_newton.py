"""Gauss-Newton over all windows at once: initial states eliminated, Huber weights, damped steps.

Minimised over the free parameters p and the initial state of each window is

    sum over windows, samples, joints of  share huber((measured - predicted)/sigma)^2  + priors

in stages of growing window length. Each iteration linearises all intervals at their nodes, accepts
the step before it or takes it back, and solves the normal equations for the next one.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, huber_cost, scatter
from frictionid.errors import NoFitError
from frictionid.progress import report_step

from ..gauss_newton import box_step, scaled_inverse
from ..parameter_block import (
    Estimate,
    Parameter,
    reach,
    values_of,
    with_values,
)
from .problem import ShootingProblem
from .sample_intervals import cut_windows
from .window_steps import (
    Point,
    cost_of,
    counts_of,
    initial_state_damping,
    linearised_at,
    moved_nodes,
    opened,
    with_windows_checked,
)
from .windows import NormalEquations, Solution, eliminate_states

_DAMPING = (1e-8, 1e4)
_WORSE = 1.02  # a cost that grows by more was a step too far
_ROUNDS = 3  # of Huber weights in an iteration
_LEAST_SHARE = 0.1  # of a Gauss-Newton step
_CALMER = 0.7  # times the largest share, each time that steps go to and fro
_LEADING = 4  # iterations of the stages before the last
_CIRCLE = 8  # steps that may lead to and fro
_DAMPED = 1e-2  # Levenberg damping that makes steps small by itself
_NEAR = 0.5  # [standard errors]: steps with which those end
_STRAY = 1.0  # [standard errors]: so far steps to and fro may go
_ONWARD = 0.25  # [standard errors]: so far their mean may get on
_COARSE = 3.0  # times as long are their substeps near rest
_ROUNDING = 1e-15  # of the largest singular value
_TRACE = 1e-12  # of the information on the best known parameter


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
    def begin(self) -> tuple[float, Array]:
        """Its damping and the values (D,) it began at: its point is too large to be kept."""
        return self.damping, values_of(self.point.estimate, self.solution.problem.blocks)

    @property
    def largest(self) -> float:
        """Largest move of a parameter in standard errors."""
        return float((np.abs(self.solution.move) / self.error).max(initial=0.0))


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
    settings, solution = problem.settings, None
    lengths = settings.windows if settings.growing else settings.windows[-1:]
    stages = [(lengths[-1], problem)]
    if ended is None:
        nodes, sigma, total = problem.initial_nodes(estimate), _initial_noise(problem, use), 0
        memory = estimate.friction.law.has_memory
        few, near = min(settings.iterations, _LEADING), max(settings.tolerance, _NEAR)
        looser = replace(settings, iterations=few, tolerance=near, fine=_COARSE * settings.fine)
        leading = replace(problem, settings=looser)
        short = leading.without_shapes(estimate) if memory else leading
        stages = [(s, short) for s in lengths[:-1]] + [(lengths[-1], leading), *stages]
    else:
        nodes, sigma, total = ended.nodes, ended.sigma, ended.iterations
    for seconds, settled in stages:
        windows = cut_windows(problem.intervals, use, seconds)
        kinked = ended.kinked if ended and np.array_equal(windows, ended.windows) else None
        first = solution is None
        solution = _solve_stage(settled, windows, estimate, nodes, sigma, kinked, first)
        total += solution.iterations
        estimate, nodes, sigma = solution.estimate, solution.nodes, solution.sigma
    assert solution is not None
    return solution._replace(iterations=total)


def cost_rise(before: Solution, after: Solution, huber: float) -> float:
    """How much higher the cost is after, of the windows that count before, by the noise before."""
    size = [np.abs(s.residual) / before.sigma for s in (before, after)]
    rise = huber_cost(size[1], huber) - huber_cost(size[0], huber)
    share = before.counts[:, None] * before.share
    return float((share[..., None] * rise).sum())


def step_with_windows(solution: Solution, seconds: float) -> Solution:
    """The solution after a Gauss-Newton step with windows of another length.

    Only in intervals of windows that counted.
    """
    problem, windows = solution.problem, solution.windows[solution.closed]
    use = np.zeros(len(problem.intervals.dt), dtype=bool)
    use[windows[windows >= 0]] = True
    windows = cut_windows(problem.intervals, use, seconds)
    estimate, nodes, sigma = solution.estimate, solution.nodes, solution.sigma
    point = linearised_at(problem, windows, estimate, nodes, sigma)
    return _next_step(problem, point, sigma, _DAMPING[0], 1.0).solution


def _initial_noise(problem: ShootingProblem, use: Array) -> Array:
    """First estimate of the angle noise (n,) [rad]: what the smoother took off."""
    intervals = problem.intervals
    floor = np.maximum(1e-9 + 1e-6 * np.abs(intervals.before).max(axis=0), intervals.rounding)
    return np.maximum(scatter((intervals.before - intervals.q)[use]), floor)


def _solve_stage(
    problem: ShootingProblem,
    windows: Array,
    estimate: Estimate,
    nodes: Array,
    sigma: Array,
    kinked: Array | None,
    first: bool,
) -> Solution:
    """Gauss-Newton iterations over windows of one length, to where the physics step can follow.

    kinked : (W,) windows that are left out from the start; first : whether none came before
    """
    settings, what = problem.settings, f"windows of {windows.shape[1]} samples"
    point = linearised_at(problem, windows, estimate, nodes, sigma)
    if kinked is not None:
        point = point._replace(kinked=kinked, out=kinked)
    step, before = _next_step(problem, point, sigma, _DAMPING[0], 1.0), None
    begins, most = [step.begin], 1.0
    report_step(what, settings.iterations - 1)
    while len(begins) < settings.iterations and not _converged(step, begins):
        try:
            point, damping = _accepted_or_last(step)
        except NoFitError as error:
            return _taken_back(step, begins, first, error)
        share, most = _step_share(step, before, most)
        before = step.solution.move
        step = _next_step(problem, point, step.solution.sigma, damping, share)
        begins = [*begins, step.begin]
        report_step(what, settings.iterations - len(begins))
    try:
        problem.refuse_too_steep(step.solution.estimate)
    except NoFitError as error:
        return _taken_back(step, begins, first, error)
    converged = _converged(step, begins)
    return step.solution._replace(converged=converged, iterations=len(begins))


def _taken_back(
    step: _Step, begins: Sequence[tuple[float, Array]], first: bool, error: NoFitError
) -> Solution:
    """The solution without the last step, which the physics step cannot follow.

    Raises
    ------
    NoFitError
        Where it is the first, and never moved.
    """
    if first and (begins[0][1] == begins[-1][1]).all():
        raise error
    solution, point = step.solution, step.point
    return solution._replace(
        estimate=point.estimate,
        nodes=point.nodes,
        move=np.zeros_like(solution.move),
        iterations=len(begins),
        stopped=(f"The fit ends early, a step further cannot be computed: {error}",),
    )


def _converged(last: _Step, begins: Sequence[tuple[float, Array]]) -> bool:
    """Whether the last step was small, or the last eight or more led to and fro and nowhere.

    Where the cost has a kink (a joint that just stops in some window, a window that just counts),
    steps from either side of it point to the other one and never become small. The solution is the
    kink: from the first half of the last steps to the second none of the parameters got on, on
    average, by more than a quarter of its standard error, nor did it stray by more than one.
    """
    tolerance = last.solution.problem.settings.tolerance
    if last.largest <= last.share * tolerance and last.damping < _DAMPED:
        return True
    damped = [k for k, (damping, _) in enumerate(begins) if damping >= _DAMPED]
    way = np.stack([*(values for _, values in begins), last.solution.values]) / last.error
    longest = len(begins) - (damped[-1] + 1 if damped else 0)
    for length in range(_CIRCLE, longest + 1, 2):
        steps, half = way[-length - 1 :], (length + 1) // 2
        if np.ptp(steps, axis=0).max(initial=0.0) > _STRAY:
            return False
        onward = np.abs(steps[-half:].mean(axis=0) - steps[:half].mean(axis=0)).max(initial=0.0)
        if onward <= max(2.0 * tolerance, _ONWARD):
            return True
    return False


def _accepted_or_last(step: _Step) -> tuple[Point, float]:
    """The point that a step led to, less damping; or the point before it again, more damping.

    A step is taken back where the cost has grown, closed gaps have opened, or the physics step
    cannot follow the friction.
    """
    s, last, problem = step.solution, step.point, step.solution.problem
    huber = problem.settings.huber
    shorter = last, max(step.damping, 1e-4) * 10.0
    try:
        point = linearised_at(problem, s.windows, s.estimate, s.nodes, s.sigma)
    except NoFitError:
        if step.damping >= _DAMPING[1]:
            raise
        return shorter
    near = step.largest <= step.share * _NEAR
    point = with_windows_checked(point, last, s.move, s.sigma, huber, near)
    before, after = (cost_of(x.prediction, point.out, s.sigma, huber) for x in (last, point))
    if (opened(point, last) or after > _WORSE * before) and step.damping < _DAMPING[1]:
        return shorter
    return point, max(step.damping / 10.0, _DAMPING[0])


def _step_share(step: _Step, before: Array | None, most: float) -> tuple[float, float]:
    """Share of the next Gauss-Newton step, and the largest from now on. Oscillation is damped.

    Windows with kinks may push now one way, now the other: the share halves where the last two
    moves a, b point against each other in the metric of the normal matrix, -a H b > 0.3 |a| |b|,
    and then grows up to ever smaller ones.
    """
    if before is None:
        return step.share, most
    H, a, b = step.solution.curvature, before, step.solution.move
    against = -float(a @ H @ b)
    size = np.sqrt(max(float(a @ H @ a) * float(b @ H @ b), 0.0))
    if against > 0.3 * size:
        return max(0.5 * step.share, _LEAST_SHARE), max(_CALMER * most, _LEAST_SHARE)
    return min(most, 1.5 * step.share), most


def _next_step(
    problem: ShootingProblem, point: Point, sigma: Array, damping: float, share: float
) -> _Step:
    """The step from a linearised point, by least squares reweighted a few times."""
    prediction, huber = point.prediction, problem.settings.huber
    weight = np.ones_like(prediction.error)
    slow = initial_state_damping(problem, point, sigma)
    counts = counts_of(point, sigma, huber)
    for _ in range(_ROUNDS):
        normal = eliminate_states(prediction, weight, sigma, point.prior, slow, counts)
        H, move = _move(problem, point, normal, damping, share)
        start = normal.start - normal.to_start @ move
        moves = np.concatenate([start, np.broadcast_to(move, (len(start), len(move)))], axis=1)
        residual = prediction.error - (prediction.slope @ moves[:, None, :, None])[..., 0]
        least = np.maximum(1e-3 * sigma, problem.intervals.rounding)
        sigma = np.maximum(_noise(residual, prediction.share, normal.leverage), least)
        weight = np.minimum(1.0, huber / np.maximum(np.abs(residual) / sigma, 1e-12))
    low, high, _, precision = problem.limits
    # by rounding a step to a bound may end beyond it: levels of -1e-17 push
    wanted = np.clip(values_of(point.estimate, problem.blocks) + move, low, high)
    free = (wanted > low + 1e-12) & (wanted < high - 1e-12)
    solution = Solution(
        problem=problem,
        estimate=with_values(point.estimate, problem.blocks, wanted),
        nodes=moved_nodes(problem, point, moves),
        windows=point.windows,
        residual=residual,
        share=prediction.share,
        weight=weight,
        sigma=sigma,
        normal=normal,
        move=move,
        free=free,
        counts=counts,
        kinked=point.kinked,
    )
    error = _errors(solution, H, precision)
    return _Step(point, solution, damping, share, error)


def _move(
    problem: ShootingProblem, point: Point, normal: NormalEquations, damping: float, share: float
) -> tuple[Array, Array]:
    """H (D, D) of all windows with priors, and the move (D,) of the parameters within bounds.

    H move = g,    H = sum H_w + diag(1/prior^2),    g = sum g_w + (mean - value)/prior^2

    It goes no farther than `reach`.

    damping : Levenberg's; share : of the Gauss-Newton step
    """
    limits, value = problem.limits, values_of(point.estimate, problem.blocks)
    H = normal.H.sum(axis=0) + np.diag(limits.precision)
    g = normal.g.sum(axis=0) + limits.precision * (limits.mean - value)
    regular = H + _missing_information(H, problem.parameters)
    down, up = reach(problem.parameters, value)
    low, high = np.maximum(limits.low - value, -down), np.minimum(limits.high - value, up)
    return H, share * box_step(regular[None], g[None], low[None], high[None], damping)[0]


def _missing_information(H: Array, parameters: Sequence[Parameter]) -> Array:
    """What H (D, D) lacks on its diagonal, so that parameters without a trace do not run away.

    Each should have a trillionth of the information on the best known one of its block and unit.
    """
    information, kinds = np.diag(H), [(p.block, p.unit) for p in parameters]
    pairs = list(zip(kinds, information, strict=True))
    most = {kind: max(size for other, size in pairs if other == kind) for kind in set(kinds)}
    return np.diag(np.maximum([_TRACE * most[kind] for kind in kinds] - information, 0.0))


def _noise(residual: Array, share: Array, leverage: Array) -> Array:
    """Angle noise (n,) [rad] from the residuals, each corrected for its leverage."""
    counts = share > 0
    clean = residual / np.sqrt(np.maximum(1.0 - leverage, 0.05))
    return scatter(clean[counts])


def _errors(solution: Solution, H: Array, precision: Array) -> Array:
    """Standard errors (D,) by which moves are judged, with H (D, D) of all windows and priors.

    Infinite for parameters that are at a bound or leave no trace, and larger where a part of the
    information comes from a prior. They are those by the curvature, or by the scatter between
    windows where that is larger: what a model does not explain is an error that the samples of a
    window share.

        H^-1 (sum_w s_w s_w') H^-1,    s_w = g_w - H_w move
    """
    free, normal = solution.free, solution.normal
    inverse = scaled_inverse(H[np.ix_(free, free)], _ROUNDING)
    score = (normal.g - normal.H @ solution.move)[:, free] @ inverse
    variance = np.diag(inverse)
    by_data = np.clip(1.0 - precision[free] * variance, 0.0, 1.0)
    shown = (variance > 0.0) & (by_data > 0.0)
    scatter = np.einsum("wd,wd->d", score, score)
    error = np.full(len(free), np.inf)
    error[np.flatnonzero(free)[shown]] = np.sqrt(
        np.maximum(variance, scatter)[shown] / by_data[shown]
    )
    return error
