"""Sizes that a fold's training rows have: those of its friction torques and of its velocities."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array, times
from frictionid.friction.laws import CoulombViscous
from frictionid.identifiers.least_squares import LeastSquares
from frictionid.identifiers.residual import Problem

_FAST = 0.99  # of the rows are slower than what counts as the reach of the data
_LEAST = 0.01  # of the torques that move the joints: joints hardly rub below it


def torque_scale(problem: Problem, weights: Array) -> Array:
    """Friction torque (F, n) [N m] of each joint at its usual speed, or a little where it has none.

    Raises
    ------
    InputError
        Where a joint slides in too few rows of a fold.
    """
    theta = LeastSquares(CoulombViscous()).fit(problem, weights, 0).theta
    share = weights / weights.sum(axis=1, keepdims=True)
    speed = np.sqrt(share @ _middle_speed(problem) ** 2)
    inertia = np.abs(np.linalg.pinv(problem.G, rcond=1e-9))
    force = np.sqrt(share @ times(inertia, np.abs(problem.r)) ** 2)
    return np.maximum(theta[..., 0] + theta[..., 1] * speed, _LEAST * force)


def speed_scale(problem: Problem, weights: Array) -> Array:
    """Speed (F, n) [rad/s] that nearly all rows of a fold stay below."""
    speed = _middle_speed(problem)
    out = [np.quantile(speed[weight > 0], _FAST, axis=0) for weight in weights]
    return np.maximum(np.stack(out), 1e-2)


def _middle_speed(problem: Problem) -> Array:
    return np.abs(problem.mean(problem.nodes.inputs.w))
