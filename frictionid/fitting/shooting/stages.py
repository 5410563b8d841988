"""Stages of a fit by shooting: solved, with priors that weigh what they say, unknowns at neutral.

A fit goes through several stages with fewer free parameters, each from where the last one ended.
"""

from collections.abc import Sequence
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

from ..neutral import Idle, LocalCost, Unknown, at_neutral, followed, holding_unknown
from ..parameter_block import (
    Estimate,
    Key,
    ParameterBlock,
    values_of,
    with_excess,
    with_values,
)
from ..sandwich import excess_of
from .data_checks import check_blocks, check_data, telling
from .gauss_newton import cost_rise, solve
from .networks import as_given, goes_astray, on_arrays, torque_samples, with_combinations
from .problem import ShootingProblem, shooting_problem
from .sample_intervals import Intervals
from .servo import with_servo
from .settings import Settings
from .windows import Solution

_CURVES = 3  # times that a fit goes on with another curve of a network
_KEPT = 0.8  # of the windows that count
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


def with_neutral(stage: Stage) -> Stage:
    """The stage with parameters held that the data do not tell."""
    stage, tried = holding_unknown(
        stage, local_cost, lambda rest, several: without(rest, (several, ())), stage.tried
    )
    return stage._replace(tried=tried)


def local_cost(stage: Stage) -> LocalCost:
    """The cost about where the stage ended."""
    s = stage.solution
    return LocalCost(s.problem.parameters, s.values, s.groups, s.estimate.friction, stage.blocks)


def without(stage: Stage, idle: Idle) -> Stage | None:
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
