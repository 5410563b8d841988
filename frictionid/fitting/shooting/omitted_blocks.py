"""Errors of the model that blocks which were not free would explain, and what they would change."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr  # scipy.stats takes half a second to import

from frictionid.arrays import Array

from ..parameters import (
    BacklashBlock,
    BiasBlock,
    DelayBlock,
    InertiaBlock,
    OffsetBlock,
    TargetDelayBlock,
)
from ..parameters.parameter_block import Estimate, ParameterBlock
from ..sandwich import sandwich, shown_once, solve_scaled
from .covariance import groups_of
from .data_checks import telling
from .gauss_newton import Solution
from .problem import ShootingProblem, shooting_problem
from .servo import has_actuator, with_servo
from .window_steps import linearised_at
from .windows import NormalEquations, eliminate_states

OFFERED: tuple[ParameterBlock, ...] = (InertiaBlock(), DelayBlock(), BiasBlock(), OffsetBlock())
OF_SERVOS: tuple[ParameterBlock, ...] = (
    InertiaBlock(),
    TargetDelayBlock(),
    BacklashBlock(),
    BiasBlock(),
    OffsetBlock(),
)
_CLEAR = 0.01  # p-value of a block that would show
_OWN = 1e-6  # of a parameter's information that no other one shares, or it is no question


class Omitted(NamedTuple):
    """Blocks that were not free and would show, and what they would change in the parameters (D,).

    p_values : of each block beside the others
    """

    blocks: tuple[str, ...]
    p_values: tuple[float, ...]
    shift: Array


def omitted_blocks(
    problem: ShootingProblem, solution: Solution, tested: Sequence[str] = ()
) -> Omitted | None:
    """Blocks that would differ significantly from what they were held at, if they were free.

    Of inertia, delay, bias and offset, of servos the targets' delay and backlash in place of the
    delay, all are freed, and the least significant one is left out until all show: by one
    Gauss-Newton step from the normal equations of all of them, with p-values by the covariance
    between recordings, times the number of the block's parameters.

    tested : names of blocks that the fit has left out after a test
    """
    fitted = tuple(free.block for free in problem.blocks)
    network = solution.estimate.friction.law.is_network
    motors = {b.name for b in fitted if b.enters == "actuator"} == {"actuator"}
    if network or motors or not problem.count:
        return None
    offered = _that_may_be_free(problem, solution, fitted, tested)
    if not offered:
        return None
    blocks = (*fitted, *offered)
    wider, start = wider_problem(problem, solution.estimate, blocks)
    normal = normal_equations(wider, solution._replace(estimate=start))
    if not np.isfinite(normal.H[solution.closed]).all():
        return None
    step = _Step(problem, wider, solution, normal)
    names = tuple(b.name for b in offered)
    while names:
        p = step.p_values(names)
        worst = int(np.argmax(p))
        if p[worst] < _CLEAR:
            return Omitted(names, p, step.shift(names))
        names = (*names[:worst], *names[worst + 1 :])
    return None


def wider_problem(
    problem: ShootingProblem, estimate: Estimate, blocks: tuple[ParameterBlock, ...]
) -> tuple[ShootingProblem, Estimate]:
    """The problem with more blocks, and the estimate with what these free."""
    intervals = problem.intervals
    estimate = with_servo(estimate, intervals.dataset, blocks)
    return shooting_problem(intervals, estimate, blocks, problem.settings), estimate


def model_error(omitted: Omitted | None) -> Array | float:
    """Covariance (D, D) of parameters that may lie anywhere between both settings."""
    return 0.0 if omitted is None else np.outer(omitted.shift, omitted.shift) / 3.0


def sentences(omitted: Omitted | None) -> tuple[str, ...]:
    """What is omitted, for people."""
    if omitted is None:
        return ()
    pairs = zip(omitted.blocks, omitted.p_values, strict=True)
    each = ", ".join(f"{name!r} (p = {p:.1g})" for name, p in pairs)
    return (f"Not free, and would show: {each}. Intervals hold what that would change; free them.",)


def _that_may_be_free(
    problem: ShootingProblem,
    solution: Solution,
    fitted: tuple[ParameterBlock, ...],
    tested: Sequence[str],
) -> tuple[ParameterBlock, ...]:
    """Blocks that are not free and may be, all together."""
    names = [*(b.name for b in fitted), *tested]
    estimate, driven = solution.estimate, has_actuator(fitted)
    if driven:
        estimate = with_servo(estimate, problem.intervals.dataset, OF_SERVOS)
    offered = [b for b in (OF_SERVOS if driven else OFFERED) if b.name not in names]
    return telling(fitted, offered, estimate, problem.intervals)[len(fitted) :]


def normal_equations(wider: ShootingProblem, solution: Solution) -> NormalEquations:
    """Normal equations of all windows, as much as each counted in the fit."""
    s = solution
    point = linearised_at(wider, s.windows, s.estimate, s.nodes, s.sigma)
    return eliminate_states(point.prediction, s.weight, s.sigma, point.prior).weighted(s.counts)


@dataclass(frozen=True, eq=False)
class _Step:
    """A Gauss-Newton step from where a fit ended, with some of the wider problem's blocks freed."""

    problem: ShootingProblem
    wider: ShootingProblem
    solution: Solution
    normal: NormalEquations

    def p_values(self, names: tuple[str, ...]) -> tuple[float, ...]:
        """P-value of each of some freed blocks; one where the others account for all it shows."""
        free = self._free(names)
        move = self._move(free)
        groups = groups_of(self.problem, self.solution._replace(normal=self.normal))
        groups = groups._replace(move=move, free=free)
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
        return np.array([p.block for p in self.wider.parameters])

    @cached_property
    def _before(self) -> Array:
        """Places (D,) of the problem's parameters among those of the wider one."""
        place = {p.name: k for k, p in enumerate(self.wider.parameters)}
        return np.array([place[p.name] for p in self.problem.parameters])

    @cached_property
    def _H(self) -> Array:
        H = self.normal.H[self.solution.closed].sum(axis=0)
        return np.asarray(H + np.diag(self.wider.limits.precision))

    def _move(self, free: Array) -> Array:
        keep, move = np.flatnonzero(free), np.zeros(len(free))
        g = self.normal.g[self.solution.closed].sum(axis=0)
        move[keep] = solve_scaled(self._H[np.ix_(keep, keep)], g[keep])
        return move


def _shared(H: Array, free: Array, members: Array) -> float:
    """Largest share of the information on a parameter of a block that others account for."""
    rest, keep = np.flatnonzero(free & ~members), np.flatnonzero(members)
    cross = H[np.ix_(rest, keep)]
    explained = np.diag(cross.T @ solve_scaled(H[np.ix_(rest, rest)], cross))
    return float((explained / np.maximum(np.diag(H)[keep], 1e-300)).max())
