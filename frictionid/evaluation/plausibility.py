"""Physical plausibility of friction, as numbers of each model: what a friction torque cannot do.

All are shares of the size of the torque, so that one limit holds for every joint. Batch axes lead:
folds, and the friction of all data.
"""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, solve
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, at_rest

from .curves import curves, slow_speed

BEYOND = 1.5  # of the velocities of the curves: as far as extrapolation is looked at
_BEYOND_POINTS = 8  # of the curves' velocities one in so many
_TAIL = 0.75  # of the fastest velocity: from there on is the tail
_SLIGHTLY = 1e-6  # [rad/s], of the impending motion of a joint at rest


class Beyond(NamedTuple):
    """What a friction says where no motion was recorded.

    velocity : (U, n) [rad/s], half as far again as the curves; curves : (F, U, n) [N m] there
    break_away : (F, 2, n) [N m], largest torque that holds the joint against motion in negative and
        positive direction; zero where a memory holds it, or nothing does
    """

    velocity: Array
    curves: Array
    break_away: Array


def beyond_motion(friction: Friction, grid: Array) -> Beyond:
    """Extrapolated curves and break-away levels of friction (F, n, P); grid (V, n) of its curves.

    >>> from frictionid.friction.laws import CoulombViscous
    >>> tf = Friction(CoulombViscous(), np.array([[[0.1, 0.02]]]))
    >>> beyond = beyond_motion(tf, np.linspace(-4.0, 4.0, 401)[:, None])
    >>> beyond.curves[0, -1].round(2), beyond.break_away[0, :, 0].round(2)
    (array([0.22]), array([0.1, 0.1]))
    """
    velocity = BEYOND * grid[::_BEYOND_POINTS]
    theta = friction.theta
    levels = []
    for direction in (-1.0, 1.0):
        x = at_rest(np.full(friction.n, direction * _SLIGHTLY))
        levels.append(friction.law.limit(theta, x, friction.law.start(theta, x)))
    shape = (len(theta), friction.n)
    whole = [np.broadcast_to(np.asarray(level, dtype=float), shape) for level in levels]
    return Beyond(velocity, np.asarray(curves(friction, velocity)), np.stack(whole, axis=1))


def lowest_dissipation(velocity: Array, torque: Array) -> Array:
    """Lowest torque against the motion, share of its RMS (..., n); negative where it drives.

    velocity (V, n), torque (..., V, n), without slow velocities (`slow_speed`).

    >>> w = np.linspace(-2.0, 2.0, 401)[:, None]
    >>> lowest_dissipation(w, 0.3 * np.sign(w) - 0.2 * w).round(2)  # drives above 1.5 rad/s
    array([-0.66])
    """
    use = np.abs(velocity) >= slow_speed(np.abs(velocity).max(axis=0))
    against = np.where(use, torque * np.sign(velocity), np.inf).min(axis=-2)
    return np.asarray(against / _size(torque))


def asymmetry(velocity: Array, torque: Array) -> Array:
    """Half the sum of both directions' torques, share of its RMS (..., n); velocity symmetric.

    >>> w = np.linspace(-2.0, 2.0, 401)[:, None]
    >>> asymmetry(w, np.where(w > 0, 1.1, -0.9)).round(2)
    array([0.1])
    """
    half = len(velocity) // 2
    both = 0.5 * (torque[..., ::-1, :][..., :half, :] + torque[..., :half, :])
    return np.asarray(both.mean(axis=-2) / _size(torque))


def tail_drop(velocity: Array, torque: Array) -> Array:
    """By how much the torque falls over the fastest quarter of the speeds, share of its RMS.

    The larger one of both directions, shape (..., n); negative where it rises.
    """
    speed = np.abs(velocity)
    inner = (speed < _TAIL * speed.max(axis=0)).argmax(axis=0)  # where the tail of w < 0 ends
    joints, last = np.arange(velocity.shape[-1]), len(velocity) - 1
    size = np.abs(torque)
    drops = [
        size[..., inner, joints] - size[..., 0, :],
        size[..., last - inner, joints] - size[..., last, :],
    ]
    return np.asarray(np.maximum(*drops) / _size(torque))


def cycle_work(velocity: Array, torque: Array) -> Array:
    """Work of a torque (..., T) over a closed cycle of the velocity (T,), evenly sampled.

    Share of what its RMS would dissipate, negative where the cycle gives energy.

    >>> w = np.sin(np.linspace(0, 2 * np.pi, 200, endpoint=False))
    >>> cycle_work(w, 0.2 * np.sign(w)).round(2), cycle_work(w, -0.2 * w).round(2)
    (np.float64(1.0), np.float64(-1.11))
    """
    size = np.sqrt(np.mean(torque**2, axis=-1))
    most = np.where(size > 0, size, np.inf) * np.mean(np.abs(velocity))
    return np.asarray(np.mean(torque * velocity, axis=-1) / most)


def dissipated(problem: Problem, residual: Array, use: Array) -> Array:
    """Energy (2, k) [J] of k rows that friction takes: by the motion alone, and by a model.

    With the residual e = r - G Tf of the model (k, n), the motion implies the torque G^-1 r, the
    model has G^-1 (r - e). use : (K,) true for the k rows of a momentum balance
    """
    n = residual.shape[-1]  # all friction as torques on the joints
    G, r = problem.G[use][:, :n, :n], problem.r[use][:, :n]
    w = problem.mean(problem.nodes.inputs.w)[use][:, :n]
    both = np.stack([r, r - residual])
    torque = solve(np.broadcast_to(G, (2, *G.shape)), both)
    return np.asarray(problem.dt[use] * (w * torque).sum(axis=-1))


def _size(torque: Array) -> Array:
    """Root mean square over the velocities (..., n); infinite where there is no torque."""
    size = np.sqrt(np.mean(np.square(torque), axis=-2))
    return np.where(size > 0, size, np.inf)
