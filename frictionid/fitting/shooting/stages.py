"""Stages of a fit by shooting: solved, with priors that weigh what they say, unknowns at neutral.

A fit goes through several stages with fewer free parameters, each from where the last one ended.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import Calibration
from frictionid.data.state_estimators import slowest_speeds
from frictionid.errors import InputError, NoFitError
from frictionid.friction import PEAK_SHOWN, DataRange, Friction, constraints_of
from frictionid.friction.coordinates import of_parts, turns_of, with_units_of
from frictionid.friction.provenance import Dropped

from ..neutral import Idle, LocalCost, Unknown, at_neutral, followed, holding_unknown, parts_of
from ..one_step.recipe import CLEAR
from ..parameter_block import (
    IDEAL,
    Estimate,
    Key,
    ParameterBlock,
    values_of,
    with_excess,
    with_values,
)
from ..sandwich import excess_of
from .data_checks import check_blocks, check_data, explained, is_astray, telling
from .gauss_newton import cost_rise, solve, step_with_windows
from .networks import as_given, goes_astray, on_arrays, torque_samples, with_combinations
from .problem import ShootingProblem, shooting_problem
from .sample_intervals import Intervals
from .servo import with_servo
from .settings import WINDOWS, Settings
from .windows import Solution

_CURVES = 3  # times that a fit goes on with another curve of a network
_ROUGH = 0.25  # [standard errors]: tolerance of a fit that shows what is idle
_VELOCITIES = np.geomspace(0.01, 100.0, 13)  # [rad/s, m/s] that are tried of a peak
_KEPT = 0.8  # of the windows that count
# Windows that hold a reversal are the ones that are lost where most hold none; longer ones all do.
_MANY, _LONGER = 0.75, 3.0  # of the windows that count; times their length where there are fewer
_SHORTER, _FEWEST = 0.25, 5  # of a window's length before; samples in the shortest
_FOLLOWS = 1e-3  # [sizes]: how near a parameter stays to those that it is like
_WEIGHTS, _ALIKE = 3, 0.2  # times that priors are weighed, until their logarithms agree


class Stage(NamedTuple):
    """A fit on the way: where it begins, what is free, where it ended, and what was left out.

    use : (K,) true for the intervals that may be used
    tried : parameters that have been held, or were shown to be needed
    network : with the weights that give where it ended, of a network
    """

    friction: Friction
    blocks: tuple[ParameterBlock, ...]
    intervals: Intervals
    settings: Settings
    use: Array
    ended: Solution | None = None
    dropped: tuple[Dropped, ...] = ()
    held: tuple[Unknown, ...] = ()
    tried: tuple[Key, ...] = ()
    network: Friction | None = None

    @property
    def solution(self) -> Solution:
        assert self.ended is not None
        return self.ended

    def ending(self, error: NoFitError) -> "Stage":
        """The stage as it is, as a further fit failed."""
        words = f"A further fit failed, this one stays: {error}"
        return self._replace(ended=self.solution._replace(stopped=(words,)))

    @property
    def problem(self) -> ShootingProblem:
        return self.solution.problem


def solved(stage: Stage) -> Stage:
    """The stage with its fit, from where it ended before, under priors that weigh what they say."""
    stage = _fitted(stage)
    if stage.friction.law.is_network:  # what holds its combinations is no knowledge of anybody
        return _with_network(stage)
    for _ in range(_WEIGHTS):
        parameters = stage.problem.parameters
        excess = excess_of(stage.solution.groups, parameters)
        weighed = np.array([p.excess for p in parameters])
        if np.abs(np.log(excess / weighed)).max(initial=0.0) < _ALIKE:
            break
        weighing = stage._replace(blocks=with_excess(stage.blocks, parameters, excess))
        try:
            stage = _fitted(weighing)
        except NoFitError as error:
            return stage.ending(error)
    return stage


def _fitted(stage: Stage) -> Stage:
    """The stage with the fit of its blocks, from where it ended before."""
    before, intervals, use = stage.ended, stage.intervals, stage.use
    problem, estimate = prepare_fit(
        stage.friction,
        intervals,
        stage.blocks,
        stage.settings,
        use,
        before=before and before.problem,
    )
    if before is not None:
        estimate = with_values(estimate, problem.blocks, values_of(before.estimate, problem.blocks))
    solution = solve(problem, estimate, use, before)
    if not solution.closed.any():
        raise NoFitError(
            f"data set {intervals.dataset.name!r}: the fit went astray, and predicts no window of "
            "the recordings: free less, or begin with a model that predicts them"
        )
    return stage._replace(ended=solution)


def _with_network(stage: Stage) -> Stage:
    """The stage with what the weights of a network give.

    Where a curve goes too far for them, the fit goes on from the nearest ones, a few times with
    the curve of these, then with the layers themselves.
    """
    for left in range(_CURVES, -1, -1):
        end = stage.solution.estimate
        network = as_given(end.friction, stage.friction)
        if not goes_astray(end.friction, network):
            break
        problem, estimate = prepare_fit(
            network, stage.intervals, stage.blocks, stage.settings, stage.use, left > 0
        )
        estimate = end._replace(friction=estimate.friction)
        ended = solve(problem, estimate, stage.use, stage.solution)
        stage = stage._replace(friction=network, ended=ended)
    else:
        network = as_given(stage.solution.estimate.friction, stage.friction)
    return stage._replace(network=network)


def begun(stage: Stage) -> Stage:
    """The fitted stage, without what a rough fit of all of it shows to be idle.

    Where the rough fit loses many windows, these are made longer, unless their length was given.
    """
    law, offered = stage.friction.law, any(b.offered or b.name in IDEAL for b in stage.blocks)
    if law.is_network:
        return solved(stage)
    none_held = not offered and not any(np.isfinite(p.size) for p in law.parameters)
    settings, half = stage.settings, (stage.settings.iterations + 1) // 2
    rough = settings if none_held else replace(settings, iterations=half, tolerance=_ROUGH)
    stage = _begun_roughly(stage, rough)
    stage = stage._replace(settings=replace(settings, windows=stage.settings.windows))
    if not explained(stage.solution):
        # intervals hold the errors of the model then, and say little of what the data tell
        blocks = (replace(b, offered=False) if b.enters == "base" else b for b in stage.blocks)
        stage = stage._replace(blocks=tuple(blocks))
    if none_held:
        return stage
    idle = _local_cost(stage).idle((), settings.significance)
    try:
        return _without(stage, idle) or solved(stage)
    except NoFitError as error:
        return stage.ending(error)


def _begun_roughly(stage: Stage, rough: Settings) -> Stage:
    """The stage with a rough fit, of other windows where that of usual ones does not hold.

    Of longer ones where it loses many or all, of shorter ones where it goes astray:
    friction that falls with the speed soon makes of the noise of a start any motion at all.
    """
    usual, start = rough.windows == WINDOWS, stage._replace(settings=rough)
    try:
        stage = _with_peaks(solved(start))
        if not usual:
            return stage
        if is_astray(stage.solution) and not explained(stage.solution):
            return _begun_otherwise(start, stage)
        if stage.solution.closed.mean() >= _MANY:
            return stage
    except NoFitError:
        if not usual:
            raise
        stage = start
    windows = rough.at(float(np.median(stage.intervals.dt))).windows
    longer = replace(rough, windows=tuple(_LONGER * w for w in windows))
    try:
        return solved(stage._replace(settings=longer))
    except InputError:  # the recordings are too short for these
        if stage.ended is None:
            raise
        return stage


def _begun_otherwise(start: Stage, astray: Stage) -> Stage:
    """The first fit from the start that does not go astray, in windows as short as samples allow.

    If none does, offered base parameters are held: friction alone may move a joint.
    """
    base = [b.name for b in start.blocks if b.enters == "base" and b.offered]
    blocks = tuple(b for b in start.blocks if b.name not in base)
    dropped = tuple(Dropped(name, None) for name in base)
    held = start._replace(blocks=blocks, dropped=(*start.dropped, *dropped))
    for stage in (*_in_shorter_windows(start), *_in_shorter_windows(held)):
        try:
            astray = _with_peaks(solved(stage))
        except NoFitError:
            continue
        if not is_astray(astray.solution):
            break
    return astray


def _in_shorter_windows(stage: Stage) -> Iterator[Stage]:
    windows = stage.settings.windows
    shortest = float(np.median(stage.intervals.dt)) * _FEWEST
    while windows[0] > shortest:
        share = max(_SHORTER, shortest / windows[0])
        windows = tuple(share * w for w in windows)
        yield stage._replace(settings=replace(stage.settings, windows=windows))


def _with_peaks(stage: Stage) -> Stage:
    """The stage with peaks that ended at zero, and would not at another velocity.

    A velocity is without trace there: friction is the same with any, the slope of its peak is not.
    All are tried at once, as friction of one joint hardly changes what that of another explains.
    """
    problem, solution = stage.problem, stage.solution
    no_trace = np.diag(solution.curvature) == 0.0
    idle = np.flatnonzero(no_trace & [p.is_velocity for p in problem.parameters])
    if not len(idle):
        return stage
    values = solution.values
    low, high = problem.limits.low[idle], problem.limits.high[idle]
    tried = np.array([values[idle], *np.unique(np.clip(_VELOCITIES[:, None], low, high), axis=0)])
    falls = np.stack([_falls(stage, _with(stage, idle, v), idle) for v in tried])
    best = falls.argmax(axis=0)
    most = np.argsort(-falls.max(axis=0))
    better = most[falls.max(axis=0)[most] >= falls[0, most] + CLEAR]
    for several in parts_of(better):
        others = _with(stage, idle[several], tried[best[several], several])
        try:
            trial = solved(stage._replace(ended=solution._replace(estimate=others)))
        except InputError:  # it went astray
            continue
        if cost_rise(solution, trial.solution, problem.settings.huber) < 0.0:
            return _with_peaks(trial)
    return stage


def _with(stage: Stage, places: Array, new: Array) -> Estimate:
    """The estimate of the stage with other values (k,) of some of its free parameters."""
    values = stage.solution.values
    values[places] = new
    return with_values(stage.solution.estimate, stage.problem.blocks, values)


def _falls(stage: Stage, estimate: Estimate, velocities: Array) -> Array:
    """How much friction at the joint of each velocity (k,) lowers the cost in one step.

    In squares of the noise, from an estimate with ended states; nothing where the physics step
    cannot follow its friction.
    """
    problem, ended = stage.problem, stage.solution._replace(estimate=estimate)
    try:
        step = step_with_windows(ended, problem.settings.windows[-1])
    except InputError:
        return np.zeros(len(velocities))
    slope = step.normal.g[step.closed].sum(axis=0)
    each = (2.0 * slope - step.curvature @ step.move) * step.move
    joints = np.array([p.place[0] if p.block == "friction" else -1 for p in problem.parameters])
    return np.array([each[joints == joints[k]].sum() for k in velocities])


def with_neutral(stage: Stage) -> Stage:
    """The stage with parameters held that the data do not tell."""
    stage, tried = holding_unknown(
        stage, _local_cost, lambda rest, several: _without(rest, (several, ())), stage.tried
    )
    return stage._replace(tried=tried)


def _local_cost(stage: Stage) -> LocalCost:
    s = stage.solution
    return LocalCost(s.problem.parameters, s.values, s.groups, s.estimate.friction, stage.blocks)


def _without(stage: Stage, idle: Idle) -> Stage | None:
    """The stage without what is idle; None where that is nothing, or the fit clearly worse."""
    solution, (held, dropped) = stage.solution, idle
    if not any(idle):
        return None
    blocks, friction = at_neutral(stage.blocks, stage.friction, held)
    friction = replace(friction, constraints=solution.estimate.friction.constraints)
    blocks = tuple(b for b in blocks if b.name not in {d.block for d in dropped})
    trial = stage._replace(friction=friction, blocks=blocks, held=(*stage.held, *held))
    try:
        trial = _following(solved(trial))
    except InputError:  # it went astray
        return None
    rise = cost_rise(solution, trial.solution, stage.settings.huber)
    lost = trial.solution.closed.sum() < _KEPT * solution.closed.sum()
    if lost or any(u.shown(rise) for u in held):
        return None
    return trial._replace(dropped=(*stage.dropped, *dropped))


def _following(stage: Stage) -> Stage:
    """The stage with held parameters that are like others at the values of these."""
    held = followed(stage.solution.estimate.friction, stage.held)
    off = [abs(u.neutral - v.neutral) / u.size for u, v in zip(held, stage.held, strict=True)]
    if max(off, default=0.0) < _FOLLOWS:
        return stage
    _, friction = at_neutral((), stage.friction, held)
    return solved(stage._replace(friction=friction, held=held))


def prepare_fit(
    friction: Friction,
    intervals: Intervals,
    blocks: Sequence[ParameterBlock],
    settings: Settings,
    use: Array | None = None,
    curves: bool = True,
    before: ShootingProblem | None = None,
) -> tuple[ShootingProblem, Estimate]:
    """The problem of fitting the blocks to intervals, and the estimate that the fit begins with.

    use : (K,) true for the intervals that may be used, all by default
    curves : whether a static network is fitted as a curve
    before : see `shooting_problem`
    """
    use = np.ones(len(intervals.dt), dtype=bool) if use is None else use
    settings = settings.at(float(np.median(intervals.dt)))
    estimate, blocks = _begin(friction, intervals, blocks, use, curves)
    check_blocks(blocks, estimate, intervals)
    problem = shooting_problem(intervals, estimate, blocks, settings, before)
    check_data(intervals, problem.parameters, settings.windows[-1])
    return problem, estimate


def _begin(
    friction: Friction,
    intervals: Intervals,
    blocks: Sequence[ParameterBlock],
    use: Array,
    curves: bool = True,
) -> tuple[Estimate, Sequence[ParameterBlock]]:
    """The estimate that a fit begins with; of a network also the blocks of its combinations."""
    mechanism = intervals.dataset.mechanism
    base = mechanism.base(mechanism.nominal(friction.parameters))
    calibration = friction.calibration or Calibration.ideal(mechanism.n)
    calibration = calibration if calibration.base is not None else replace(calibration, base=base)
    network = friction.law.is_network
    friction = with_units_of(mechanism, on_arrays(friction))
    if friction.constraints is None and not network:
        limits = constraints_of(friction.law, _speed_range(intervals, use))
        friction = replace(friction, constraints=limits)
    if network:
        samples = torque_samples(friction, mechanism, calibration, intervals, use)
        friction, blocks = with_combinations(friction, samples, blocks, curves)
    estimate = Estimate(friction, calibration, mechanism)
    return with_servo(estimate, intervals.dataset, blocks), blocks


def that_may_be_free(
    blocks: Sequence[ParameterBlock], friction: Friction, intervals: Intervals, use: Array
) -> tuple[ParameterBlock, ...]:
    """The blocks, of those that are offered the ones that these data can tell beside the others."""
    offered = [b for b in blocks if b.offered]
    if not offered:
        return tuple(blocks)
    estimate, _ = _begin(friction, intervals, blocks, use)
    return telling(tuple(b for b in blocks if not b.offered), offered, estimate, intervals)


def _speed_range(intervals: Intervals, use: Array) -> DataRange:
    """Slowest and fastest speeds (m,) that the intervals in use (K,) show and resolve."""
    states = [intervals.states[i] for i in np.unique(intervals.recording[use])]
    turns = turns_of(intervals.dataset.mechanism, intervals.w)
    slowest = np.median([slowest_speeds(s) for s in states], axis=0)
    slowest = of_parts(slowest, None if turns is None else np.abs(turns))
    speeds = np.abs(of_parts(intervals.w[use], turns))
    return DataRange(np.maximum(slowest, PEAK_SHOWN * speeds.min(axis=0)), speeds.max(axis=0))
