"""Errors of the model that show between settings: other windows, and less smoothing of a law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.shooting.data_checks import explained
from frictionid.fitting.shooting.gauss_newton import Solution, move_with_windows
from frictionid.fitting.shooting.problem import ShootingProblem

_LENGTHS = (0.5, 0.7, 1.5)  # times those of the fit's windows


def settings_error(problem: ShootingProblem, solution: Solution) -> Array | float:
    """Covariance (D, D) between windows of other lengths, where the motion is not explained.

    A model that explains the motion finds the same with windows of any length, but for noise. One
    that does not errs more the longer it predicts, and its parameters are those of a length that
    somebody chose. With the moves m_k of one Gauss-Newton step each, by windows of other lengths:

        C = mean_k m_k m_k'
    """
    network = solution.estimate.friction.law.is_network
    if explained(problem, solution) or network or not problem.count:
        return 0.0
    seconds, moves = problem.settings.windows[-1], []
    for length in _LENGTHS:
        try:
            moves.append(move_with_windows(problem, solution, length * seconds))
        except InputError:  # no three intervals in one piece are left
            continue
    known = [move for move in moves if np.isfinite(move).all()]
    return np.mean([np.outer(m, m) for m in known], axis=0) if known else 0.0


def smoothing_error(problem: ShootingProblem, solution: Solution) -> Array | float:
    """Covariance (D, D) of what a law's own smoothing does to its parameters.

    The bias is in proportion to the smoothing: with the move m of one Gauss-Newton step by the law
    with half of it, the law without any would move the parameters by 2 m.

        C = (2 m) (2 m)'
    """
    friction = solution.estimate.friction
    finer = friction.law.finer()
    if finer is friction.law or not problem.count:
        return 0.0
    estimate = solution.estimate._replace(friction=replace(friction, law=finer))
    there = solution._replace(estimate=estimate)
    move = 2.0 * move_with_windows(problem, there, problem.settings.windows[-1])
    return np.outer(move, move) if np.isfinite(move).all() else 0.0
