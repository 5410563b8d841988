"""How a fit by shooting begins: roughly, in windows that suit, with peaks that show.

Where predictions go astray it begins again in shorter windows, or without base parameters.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError, NoFitError
from frictionid.friction.provenance import Dropped

from ..neutral import parts_of
from ..one_step.recipe import CLEAR
from ..parameter_block import IDEAL, Estimate, with_values
from .data_checks import base_runs_off, explained, is_astray
from .gauss_newton import cost_rise, step_with_windows
from .settings import WINDOWS, Settings
from .stages import Stage, local_cost, solved, without

_ROUGH = 0.25  # [standard errors]: tolerance of a fit that shows what is idle
_VELOCITIES = np.geomspace(0.01, 100.0, 13)  # [rad/s, m/s] that are tried of a peak
# Windows that hold a reversal are the ones that are lost where most hold none; longer ones all do.
_MANY, _LONGER = 0.75, 3.0  # of the windows that count; times their length where there are fewer
_SHORTER, _FEWEST = 0.25, 5  # of a window's length before; samples in the shortest
_CLEARLY = 1.5  # times the shortest, above which windows become shorter


def begun(stage: Stage) -> Stage:
    """The fitted stage, without what a rough fit of all of it shows to be idle.

    Where the rough fit loses many windows, these are made longer, unless their length was given.
    Base parameters that run off in the end, where nothing is explained, are held if offered.
    """
    law, offered = stage.friction.law, any(b.offered or b.name in IDEAL for b in stage.blocks)
    if law.is_network:
        return solved(stage)
    none_held = not offered and not any(np.isfinite(p.size) for p in law.parameters)
    settings, half = stage.settings, (stage.settings.iterations + 1) // 2
    rough = settings if none_held else replace(settings, iterations=half, tolerance=_ROUGH)
    stage = _begun_roughly(stage, rough)
    stage = stage._replace(settings=replace(settings, windows=stage.settings.windows))
    held = _base_held(stage)
    if not explained(stage.solution):
        # intervals hold the errors of the model then, and say little of what the data tell
        blocks = (replace(b, offered=False) if b.enters == "base" else b for b in stage.blocks)
        stage = stage._replace(blocks=tuple(blocks))
    if none_held:
        return stage
    idle = local_cost(stage).idle((), settings.significance)
    try:
        ended = without(stage, idle) or solved(stage)
        astray = base_runs_off(ended.solution) and not explained(ended.solution)
        return solved(held) if held and astray else ended
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

    If none does, that of usual windows stays; or, where base parameters run off, the last one with
    offered ones held: friction alone may move a joint.
    """
    held = _base_held(start) if base_runs_off(astray.solution) else None
    for stage in (start, held):
        for shorter in _in_shorter_windows(stage) if stage else ():
            try:
                fitted = _with_peaks(solved(shorter))
            except NoFitError:
                continue
            if not is_astray(fitted.solution):
                return fitted
            astray = fitted if held else astray
    return astray


def _base_held(stage: Stage) -> Stage | None:
    """The stage without base parameters that were offered; None where none were."""
    base = [b.name for b in stage.blocks if b.enters == "base" and b.offered]
    blocks = tuple(b for b in stage.blocks if b.name not in base)
    dropped = tuple(Dropped(name, None) for name in base)
    return stage._replace(blocks=blocks, dropped=(*stage.dropped, *dropped)) if base else None


def _in_shorter_windows(stage: Stage) -> Iterator[Stage]:
    windows = stage.settings.windows
    shortest = float(np.median(stage.intervals.dt)) * _FEWEST
    while windows[0] >= _CLEARLY * shortest:
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
