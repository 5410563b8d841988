"""Refine a friction by shooting, with whatever else the blocks free."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import stdtr  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset
from frictionid.data.state_estimators import RTS, States
from frictionid.errors import InputError, NoFitError
from frictionid.friction import Friction
from frictionid.friction.laws.levels import LOAD
from frictionid.friction.provenance import Estimates, Residuals, Segment

from ..covariance import least_significant, without_shared
from ..fit import Covariance, Fit
from ..neutral import OWN, at_neutral_bound, freed, sentences_of, with_held
from ..one_step.recipe import states_of
from ..one_step.torque_outliers import without_torque_outliers
from ..parameter_block import IDEAL, ParameterBlock
from ..parameters import (
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
    on_support,
)
from ..sandwich import Groups, sandwich, shown_once, solve_scaled, step_of, worth
from .beginning import begun
from .data_checks import (
    explained,
    no_plateau,
    odd_recordings,
    odd_sentences,
    telling,
    wanders,
    warnings_of,
)
from .gauss_newton import step_with_windows
from .networks import as_given
from .problem import shooting_problem
from .sample_intervals import Intervals, intervals_of
from .servo import has_actuator, with_servo
from .settings import DEFAULT_BLOCKS, Settings, applicable
from .stages import Stage, prepare_fit, solved, that_may_be_free, with_neutral
from .window_steps import linearised_at
from .windows import Solution, eliminate_states

_LENGTHS = (0.5, 0.7, 1.5)  # times those of the fit's windows


def settings_error(solution: Solution) -> Array | float:
    """Covariance (D, D) between windows of other lengths, where the motion is not explained.

    A model that explains the motion finds the same with windows of any length, but for noise. One
    that does not errs more the longer it predicts, and its parameters are those of a length that
    somebody chose. With the moves m_k of one Gauss-Newton step each, by windows of other lengths:

        C = mean_k m_k m_k'
    """
    problem, network = solution.problem, solution.estimate.friction.law.is_network
    if explained(solution) or network or not problem.count:
        return 0.0
    seconds, moves = problem.settings.windows[-1], []
    for length in _LENGTHS:
        try:
            moves.append(step_with_windows(solution, length * seconds).move)
        except InputError:  # no three intervals in one piece are left
            continue
    finite = [np.outer(move, move) for move in moves if np.isfinite(move).all()]
    return np.mean(finite, axis=0) if finite else 0.0


def smoothing_error(solution: Solution) -> tuple[Array | float, tuple[str, ...]]:
    """Covariance (D, D) of what a law's own smoothing does to its parameters, and words.

    The bias is in proportion to the smoothing: with the move m of one Gauss-Newton step by the law
    with half of it, the law without any would move the parameters by 2 m.

        C = (2 m) (2 m)'
    """
    problem, friction = solution.problem, solution.estimate.friction
    finer = friction.law.finer()
    if finer is friction.law or not problem.count:
        return 0.0, ()
    estimate = solution.estimate._replace(friction=replace(friction, law=finer))
    there = solution._replace(estimate=estimate)
    try:
        move = 2.0 * step_with_windows(there, problem.settings.windows[-1]).move
    except NoFitError as error:
        return 0.0, (f"Intervals do not hold what the law's smoothing does: {error}",)
    return np.outer(move, move) if np.isfinite(move).all() else 0.0, ()


def load_error(solution: Solution) -> Array | float:
    """Covariance (D, D) of load coefficients by bearing loads that are off as masses may be.

    Loads follow from masses, not from the base parameters that are free. By each mass that is off
    by its tolerance they change in proportion r_i, and the coefficients k in inverse proportion:

        C = sum_i (k r_i) (k r_i)'
    """
    problem, intervals = solution.problem, solution.problem.intervals
    mechanism = solution.estimate.mechanism
    if not (solution.estimate.friction.law.uses_load and mechanism.tolerances):
        return 0.0
    nominal, (q, w) = mechanism.nominal(), (intervals.q, intervals.w)
    load = mechanism.load(nominal, q, w, 0.0 * q)
    matrix = np.zeros(2 * (problem.count,))
    joints = [p.place[0] if p.name.startswith(LOAD.name) else -1 for p in problem.parameters]
    for name, size in mechanism.errors().items():
        off = mechanism.load({**nominal, name: nominal[name] + size}, q, w, 0.0 * q) - load
        share = (off * load).sum(axis=0) / np.maximum((load * load).sum(axis=0), 1e-300)
        move = solution.values * np.array([share[j] if j >= 0 else 0.0 for j in joints])
        matrix += np.outer(move, move)
    return matrix


_UNEXPLAINED = 3.0  # [noise], root mean square of a window's residual


def refine(
    friction: Friction,
    dataset: Dataset,
    blocks: Sequence[ParameterBlock] = DEFAULT_BLOCKS,
    settings: Settings | None = None,
    *,
    sample_time: float | None = None,
    states: tuple[States, ...] | None = None,
) -> Fit:
    """Friction, and whatever else the blocks free, from the measured angles themselves.

    Windows of the recordings are predicted from free initial states by the physics step, and all
    parameters are those for which the predicted angles come closest to the measured ones, in units
    of the angle noise [Bock1983]. It starts from the given friction, its calibration and the data
    set's mechanism.

    states : of the recordings by the RTS smoother, where they have been asked for before

    Raises
    ------
    InputError
        For combinations of blocks that no data can tell apart, data too short for windows, wrapped
        angles, and friction of joints that never move.
    """
    settings = settings or Settings()
    states = states or states_of(dataset, RTS(), sample_time)
    dataset = without_torque_outliers(dataset, plant_of(dataset), states)
    return fit_blocks(friction, intervals_of(dataset, states), blocks, settings)


def fit_blocks(
    friction: Friction,
    intervals: Intervals,
    blocks: Sequence[ParameterBlock],
    settings: Settings,
    use: Array | None = None,
) -> Fit:
    """The result of a fit to the intervals in use (K,), without blocks that show nothing.

    Blocks that are offered are only free where these data can tell them from the others. While the
    deviation of a block from an ideal sensor is not significant, the fit goes on from where it
    ended without the least significant one: free parameters that show nothing would only spoil what
    the others predict. Beside a network all stay: the scatter of a few recordings about so many
    combinations says little. An offset of angles is free beside a bias where it would show.
    Parameters of friction that the data do not tell are held at the law's neutral values, base
    parameters that are offered at the nominal ones, see `neutral`.
    """
    use = np.ones(len(intervals.dt), dtype=bool) if use is None else use
    may_be_off = any(b.name == _OFFSET.name and b.offered for b in blocks)
    blocks = on_support(applicable(blocks, intervals.dataset, friction.law), friction)
    blocks = that_may_be_free(blocks, friction, intervals, use)
    stage = begun(Stage(friction, blocks, intervals, settings, use))
    while True:
        stage = with_neutral(stage)
        result, omitted = refined_by(stage, friction)
        level = 1.0 if friction.law.is_network else settings.significance
        idle = least_significant(result.covariance, stage.blocks, level)
        if idle is not None:
            blocks = tuple(b for b in stage.blocks if b.name != idle.block)
            other = stage._replace(blocks=blocks, dropped=(*stage.dropped, idle))
        elif may_be_off and _OFFSET.name in omitted:
            may_be_off, other = False, stage._replace(blocks=(*stage.blocks, _OFFSET))
        else:
            return result
        try:
            stage = solved(other)
        except NoFitError as error:
            return refined_by(stage.ending(error), friction)[0]


def fit_as_begun(
    friction: Friction,
    intervals: Intervals,
    blocks: Sequence[ParameterBlock],
    settings: Settings,
    use: Array,
) -> Fit:
    """What `fit_blocks` begins with, with its calibration."""
    blocks = on_support(applicable(blocks, intervals.dataset, friction.law), friction)
    _, estimate = prepare_fit(friction, intervals, blocks, settings, use)
    return Fit(replace(friction, calibration=estimate.calibration, parameters={}))


def refined_by(stage: Stage, start: Friction) -> tuple[Fit, tuple[str, ...]]:
    """The result, without what was dropped or held, and blocks that are not free and would show."""
    solution, estimate = stage.solution, stage.solution.estimate
    error, omitted, words = omitted_blocks(solution, [d.block for d in stage.dropped])
    smoothing, unsaid = smoothing_error(solution)
    shared = error + settings_error(solution) + smoothing + load_error(solution)
    covariance = solution.covariance(shared)
    words = *solution.stopped, *words, *unsaid
    limits = *words, *no_plateau(solution), *wanders(solution, covariance)
    diagnostics = _diagnostics(stage, (*limits, *sentences_of(stage.held)))
    friction, fitted = (
        replace(each, calibration=estimate.calibration, parameters={})
        for each in (stage.network or as_given(estimate.friction, start), estimate.friction)
    )
    covariance = without_shared(_with_held(covariance, stage).each, estimate.friction.law)
    return Fit(friction, covariance, diagnostics, fitted), omitted


def _with_held(covariance: Covariance, stage: Stage) -> Covariance:
    """The covariance with held parameters, and what others make up for of these and of sensors."""
    held, bound = stage.held, at_neutral_bound(covariance, stage.solution.estimate.friction)
    blocks = freed([free.block for free in stage.problem.blocks], held)
    left_out = {d.block for d in stage.dropped} & IDEAL.keys()
    sensors = _that_may_be_free(stage.solution, blocks, left_out) if left_out else ()
    if not (held or bound or sensors):
        return covariance
    wider = widened(stage.solution, (*blocks, *sensors))
    H = wider.curvature + np.diag(wider.problem.limits.precision)
    return with_held(covariance, held, bound, wider.problem.parameters, H)


def _diagnostics(stage: Stage, limits: tuple[str, ...]) -> Estimates:
    solution = stage.solution
    share = solution.share[..., None] * np.ones_like(solution.residual)
    square = (solution.residual / solution.sigma) ** 2 * share
    size = np.sqrt(square.sum(axis=(1, 2)) / np.maximum(share.sum(axis=(1, 2)), 1e-12))
    far = size > _UNEXPLAINED
    odd = odd_recordings(solution)
    return Estimates(
        angle_noise=solution.sigma,
        residuals=_residuals(solution, solution.closed & ~far),
        windows=len(solution.windows),
        left_out=_segments(solution, ~solution.closed & ~far, size),
        unexplained=_segments(solution, far, size),
        odd=odd,
        settled=solution.converged,
        iterations=solution.iterations,
        warnings=(*odd_sentences(odd), *warnings_of(solution), *limits),
        dropped=stage.dropped,
    )


def _residuals(solution: Solution, use: Array) -> Residuals:
    """Size of the residuals in some of the windows (W,), and what the parameters are worth there.

    These count by the residuals' mean squares, in place of the noise.
    """
    share = (solution.share[..., None] * np.ones_like(solution.residual))[use]
    squares = (solution.residual[use] ** 2 * share).sum(axis=(0, 1))
    counts = share.sum(axis=(0, 1)) - 2.0 * use.sum()
    groups = solution.groups
    H = groups.H.sum(axis=0) + np.diag(solution.problem.limits.precision)
    noise = float(np.mean(solution.sigma**2 * counts / np.maximum(squares, 1e-300)))
    clusters = len(np.unique(groups.cluster))
    return Residuals(squares, counts, noise * worth(H, groups), clusters)


def _segments(solution: Solution, which: Array, size: Array) -> tuple[Segment, ...]:
    intervals = solution.problem.intervals
    out = []
    for w in np.flatnonzero(which):
        rows = solution.windows[w][solution.windows[w] >= 0]
        recording = intervals.dataset.recordings[int(intervals.recording[rows[0]])]
        since = intervals.time[rows] - recording.angle.time[0]
        end = float(since[-1] + intervals.dt[rows[-1]])
        out.append(Segment(recording.name, float(since[0]), end, float(size[w])))
    return tuple(out)


# --- Errors of the model that blocks which were not free would explain ----------------------------

OFFERED: tuple[ParameterBlock, ...] = (InertiaBlock(), DelayBlock(), BiasBlock(), OffsetBlock())
OF_SERVOS = (InertiaBlock(), TargetDelayBlock(), BacklashBlock(), *OFFERED[2:])
NOT_FREE = "Not free, and would show"
_OFFSET = OffsetBlock()
_CLEAR = 0.01  # p-value of a block that would show


def omitted_blocks(
    solution: Solution, tested: Sequence[str] = ()
) -> tuple[Array | float, tuple[str, ...], tuple[str, ...]]:
    """What blocks that show, and were not free, do: covariance (D, D), their names, and words.

    They would differ significantly from what they were held at, if they were free, and parameters
    may lie anywhere between both settings.

    Of inertia, delay, bias and offset, of servos the targets' delay and backlash in place of the
    delay, all are freed, and the least significant one is left out until all show: by one
    Gauss-Newton step from the normal equations of all of them, with p-values by the covariance
    between recordings, times the number of the block's parameters.

    tested : names of blocks that the fit has left out after a test
    """
    problem = solution.problem
    fitted = tuple(free.block for free in problem.blocks)
    network = solution.estimate.friction.law.is_network
    motors = {b.name for b in fitted if b.enters == "actuator"} == {"actuator"}
    if network or motors or not problem.count:
        return 0.0, (), ()
    names = {b.name for b in (*OFFERED, *OF_SERVOS)} - {*tested}
    offered = _that_may_be_free(solution, fitted, names)
    if not offered:
        return 0.0, (), ()
    wider = widened(solution, (*fitted, *offered))
    if not np.isfinite(wider.normal.H[wider.closed]).all():
        return 0.0, (), ()
    H = wider.curvature + np.diag(wider.problem.limits.precision)
    g, parameters = wider.normal.g[wider.closed].sum(axis=0), wider.problem.parameters
    block = np.array([p.block for p in parameters])
    place = {p.name: k for k, p in enumerate(parameters)}
    before = np.array([place[p.name] for p in problem.parameters])
    left = tuple(b.name for b in offered)
    while left:
        free = np.isin(block, left)
        free[before] = True  # they may leave their bounds now
        move = step_of(H, g, free)
        groups = wider.groups._replace(move=move, free=free)
        p = _p_values(H, groups, [block == name for name in left])
        worst = int(np.argmax(p))
        if p[worst] < _CLEAR:
            alone = np.zeros(len(block), dtype=bool)
            alone[before] = solution.free
            shift, pairs = (move - step_of(H, g, alone))[before], zip(left, p, strict=True)
            each = ", ".join(f"{name!r} (p = {p_value:.1g})" for name, p_value in pairs)
            words = f"{NOT_FREE}: {each}. Intervals hold what that would change; "
            return np.outer(shift, shift) / 3.0, left, (f"{words}free them.",)
        left = (*left[:worst], *left[worst + 1 :])
    return 0.0, (), ()


def widened(solution: Solution, blocks: tuple[ParameterBlock, ...]) -> Solution:
    """The solution with more blocks, and normal equations of all windows, as much as each counts.

    Its step and what is free are still those of the fit.
    """
    s, intervals = solution, solution.problem.intervals
    estimate = with_servo(s.estimate, intervals.dataset, blocks)
    problem = shooting_problem(intervals, estimate, blocks, s.problem.settings, s.problem)
    point = linearised_at(problem, s.windows, estimate, s.nodes, s.sigma)
    at = point.prediction, s.weight, s.sigma, point.prior
    normal = eliminate_states(*at, counts=s.counts)
    return s._replace(problem=problem, estimate=estimate, normal=normal)


def _that_may_be_free(
    solution: Solution, fitted: tuple[ParameterBlock, ...], names: Collection[str]
) -> tuple[ParameterBlock, ...]:
    """Blocks of some names that are not free and may be, all together."""
    estimate, intervals = solution.estimate, solution.problem.intervals
    driven = has_actuator(fitted)
    if driven:
        estimate = with_servo(estimate, intervals.dataset, OF_SERVOS)
    names = {*names} - {b.name for b in fitted}
    offered = [b for b in (OF_SERVOS if driven else OFFERED) if b.name in names]
    return telling(fitted, offered, estimate, intervals)[len(fitted) :]


def _p_values(H: Array, groups: Groups, blocks: Sequence[Array]) -> list[float]:
    """P-value of each freed block (D,); one where the others account for all that it shows."""
    free, move = groups.free, groups.move
    shown = free & ~shown_once(H, groups)
    error = np.full(len(free), np.inf)
    error[shown] = np.sqrt(np.diag(sandwich(H, groups._replace(free=shown))))
    freedom = max(len(np.unique(groups.cluster)) - 1, 1)
    p = []
    for members in blocks:
        size = float((np.abs(move[members]) / np.maximum(error[members], 1e-300)).max())
        alone = _shared(H, free, members) <= 1.0 - OWN
        p.append(min(1.0, 2 * float(stdtr(freedom, -size)) * int(members.sum())) if alone else 1.0)
    return p


def _shared(H: Array, free: Array, members: Array) -> float:
    """Largest share of the information on a parameter of a block that others account for."""
    rest, keep = np.flatnonzero(free & ~members), np.flatnonzero(members)
    cross = H[np.ix_(rest, keep)]
    explained = np.diag(cross.T @ solve_scaled(H[np.ix_(rest, rest)], cross))
    return float((explained / np.maximum(np.diag(H)[keep], 1e-300)).max())
