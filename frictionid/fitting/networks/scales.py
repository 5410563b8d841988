"""Scales of a fold's training rows: friction torque and speed of each joint."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array, times
from frictionid.fitting.identifiers.least_squares import LeastSquares
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction.laws import CoulombViscous

_FAST = 0.99  # quantile of the rows' speeds that counts as the fastest
_SMALLEST = 0.01  # of the torques that move the joints: less friction hardly matters


def friction_scales(problem: Problem, weights: Array) -> Array:
    """Torque [N m] and speed [rad/s] of each fold and joint, (F, n, 2).

    The torque is that of Coulomb and viscous friction at the root mean square speed, or a small one
    where there is no friction; 99 % of the fold's rows are slower than the speed.

    Raises
    ------
    InputError
        Where a joint slides in too few rows of a fold.
    """
    speed = np.abs(problem.mean(problem.nodes.inputs.w))
    theta = LeastSquares(CoulombViscous()).fit(problem, weights, 0).theta
    share = weights / weights.sum(axis=1, keepdims=True)
    usual = np.sqrt(share @ speed**2)
    inertia = np.abs(np.linalg.pinv(problem.G, rcond=1e-9))
    force = np.sqrt(share @ times(inertia, np.abs(problem.r)) ** 2)
    torque = np.maximum(theta[..., 0] + theta[..., 1] * usual, _SMALLEST * force)
    fast = [np.quantile(speed[weight > 0], _FAST, axis=0) for weight in weights]
    return np.stack([torque, np.maximum(np.stack(fast), 1e-2)], axis=-1)
