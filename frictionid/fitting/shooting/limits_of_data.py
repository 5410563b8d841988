"""Sentences on what the recordings do not tell of a law: why a level is zero, why a fit wanders."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from frictionid.fitting.shooting.covariance import Covariance
from frictionid.fitting.shooting.gauss_newton import Solution
from frictionid.fitting.shooting.problem import ShootingProblem

_MOST_SPEEDS = 0.95
_AS_FAST = 0.5  # of these speeds: a Stribeck velocity that leaves no plateau


def limits_of_data(
    problem: ShootingProblem, solution: Solution, covariance: Covariance
) -> tuple[str, ...]:
    """What makes levels zero, and what keeps a fit from converging."""
    return (*_no_plateau(problem, solution), *_wanders(problem, solution, covariance))


def _no_plateau(problem: ShootingProblem, solution: Solution) -> Iterator[str]:
    """Coulomb levels that end at zero as the Stribeck velocity is as large as the speeds."""
    friction = solution.estimate.friction
    names, theta = friction.law.names, np.asarray(friction.theta)
    if "stribeck_velocity" not in names:
        return
    usual = np.quantile(np.abs(problem.intervals.w), _MOST_SPEEDS, axis=0)
    for p in problem.parameters:
        if p.block != "friction" or not names[p.place[1]].startswith("coulomb"):
            continue
        joint, falls = p.place[0], theta[p.place[0], names.index("stribeck_velocity")]
        if theta[p.place] == p.low == 0.0 and falls > _AS_FAST * usual[joint]:
            unit = friction.law.units[names.index("stribeck_velocity")]
            yield (
                f"{p.name[0].upper()}{p.name[1:]} ends at 0: friction falls off over all speeds of "
                f"the recordings (Stribeck velocity {falls:.2g} {unit}, 95 % of the speeds are "
                f"below {usual[joint]:.2g}), so that level, peak and viscous friction show only "
                "together, as one curve."
            )


def _wanders(problem: ShootingProblem, solution: Solution, covariance: Covariance) -> Iterator[str]:
    """Why a fit has not converged."""
    friction = np.array([p.block == "friction" for p in problem.parameters], dtype=bool)
    unknown = int((friction & ~covariance.identified).sum())
    if solution.converged or not unknown or solution.estimate.friction.law.is_network:
        return
    yield (
        f"It has not converged, as the recordings do not tell {unknown} of the "
        f"{int(friction.sum())} parameters of friction, and these wander: take a law with fewer, "
        "or hold some (`fixed`)."
    )
