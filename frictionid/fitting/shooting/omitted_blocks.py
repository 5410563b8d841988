"""Errors of the model that blocks which were not free would explain, and what they would change."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import stdtr  # scipy.stats takes half a second to import

from frictionid.arrays import Array

from ..parameter_block import ParameterBlock
from ..parameters import (
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
)
from ..sandwich import sandwich, shown_once, solve_scaled, step_of
from .data_checks import telling
from .problem import shooting_problem
from .servo import has_actuator, with_servo
from .window_steps import linearised_at
from .windows import Solution, eliminate_states

OFFERED: tuple[ParameterBlock, ...] = (InertiaBlock(), DelayBlock(), BiasBlock(), OffsetBlock())
OF_SERVOS: tuple[ParameterBlock, ...] = (
    InertiaBlock(),
    TargetDelayBlock(),
    BacklashBlock(),
    BiasBlock(),
    OffsetBlock(),
)
NOT_FREE = "Not free, and would show"
_CLEAR = 0.01  # p-value of a block that would show
_OWN = 1e-6  # of a parameter's information that no other one shares, or it is no question


def omitted_blocks(
    solution: Solution, tested: Sequence[str] = ()
) -> tuple[Array | float, tuple[str, ...]]:
    """What blocks that show, and were not free, do to parameters: covariance (D, D), and words.

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
        return 0.0, ()
    offered = _that_may_be_free(solution, fitted, tested)
    if not offered:
        return 0.0, ()
    wider = widened(solution, (*fitted, *offered))
    if not np.isfinite(wider.normal.H[wider.closed]).all():
        return 0.0, ()
    step = _Step(solution, wider)
    names = tuple(b.name for b in offered)
    while names:
        p = step.p_values(names)
        worst = int(np.argmax(p))
        if p[worst] < _CLEAR:
            shift, pairs = step.shift(names), zip(names, p, strict=True)
            each = ", ".join(f"{name!r} (p = {p_value:.1g})" for name, p_value in pairs)
            words = f"{NOT_FREE}: {each}. Intervals hold what that would change; "
            return np.outer(shift, shift) / 3.0, (f"{words}free them.",)
        names = (*names[:worst], *names[worst + 1 :])
    return 0.0, ()


def widened(solution: Solution, blocks: tuple[ParameterBlock, ...]) -> Solution:
    """The solution with more blocks, and normal equations of all windows, as much as each counts.

    Its step and what is free are still those of the fit.
    """
    s, intervals = solution, solution.problem.intervals
    estimate = with_servo(s.estimate, intervals.dataset, blocks)
    problem = shooting_problem(intervals, estimate, blocks, s.problem.settings, s.problem)
    point = linearised_at(problem, s.windows, estimate, s.nodes, s.sigma)
    normal = eliminate_states(point.prediction, s.weight, s.sigma, point.prior).weighted(s.counts)
    return s._replace(problem=problem, estimate=estimate, normal=normal)


def _that_may_be_free(
    solution: Solution, fitted: tuple[ParameterBlock, ...], tested: Sequence[str]
) -> tuple[ParameterBlock, ...]:
    """Blocks that are not free and may be, all together."""
    names = [*(b.name for b in fitted), *tested]
    estimate, intervals = solution.estimate, solution.problem.intervals
    driven = has_actuator(fitted)
    if driven:
        estimate = with_servo(estimate, intervals.dataset, OF_SERVOS)
    offered = [b for b in (OF_SERVOS if driven else OFFERED) if b.name not in names]
    return telling(fitted, offered, estimate, intervals)[len(fitted) :]


@dataclass(frozen=True, eq=False)
class _Step:
    """A Gauss-Newton step from where a fit ended, with some of the wider blocks freed."""

    solution: Solution
    wider: Solution

    def p_values(self, names: tuple[str, ...]) -> tuple[float, ...]:
        """P-value of each of some freed blocks; one where the others account for all it shows."""
        free = self._free(names)
        move = self._move(free)
        groups = self.wider.groups._replace(move=move, free=free)
        shown = free & ~shown_once(self._H, groups)
        error = np.full(len(free), np.inf)
        error[shown] = np.sqrt(np.diag(sandwich(self._H, groups._replace(free=shown))))
        freedom = max(len(np.unique(groups.cluster)) - 1, 1)
        p = []
        for name in names:
            members = self._block == name
            size = float((np.abs(move[members]) / np.maximum(error[members], 1e-300)).max())
            alone = _shared(self._H, free, members) <= 1.0 - _OWN
            p.append(
                min(1.0, 2 * float(stdtr(freedom, -size)) * int(members.sum())) if alone else 1.0
            )
        return tuple(p)

    def shift(self, names: tuple[str, ...]) -> Array:
        """What freeing some blocks changes in the problem's parameters (D,)."""
        alone = np.zeros(len(self._block), dtype=bool)
        alone[self._before] = self.solution.free
        return (self._move(self._free(names)) - self._move(alone))[self._before]

    def _free(self, names: tuple[str, ...]) -> Array:
        """The problem's parameters, which may leave their bounds now, and those of some blocks."""
        free = np.isin(self._block, names)
        free[self._before] = True
        return free

    @cached_property
    def _block(self) -> Array:
        return np.array([p.block for p in self.wider.problem.parameters])

    @cached_property
    def _before(self) -> Array:
        """Places (D,) of the problem's parameters among those of the wider one."""
        place = {p.name: k for k, p in enumerate(self.wider.problem.parameters)}
        return np.array([place[p.name] for p in self.solution.problem.parameters])

    @cached_property
    def _H(self) -> Array:
        return self.wider.curvature + np.diag(self.wider.problem.limits.precision)

    def _move(self, free: Array) -> Array:
        return step_of(self._H, self.wider.normal.g[self.wider.closed].sum(axis=0), free)


def _shared(H: Array, free: Array, members: Array) -> float:
    """Largest share of the information on a parameter of a block that others account for."""
    rest, keep = np.flatnonzero(free & ~members), np.flatnonzero(members)
    cross = H[np.ix_(rest, keep)]
    explained = np.diag(cross.T @ solve_scaled(H[np.ix_(rest, rest)], cross))
    return float((explained / np.maximum(np.diag(H)[keep], 1e-300)).max())
