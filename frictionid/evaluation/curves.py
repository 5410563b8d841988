"""Friction curves over velocity, and their error where the truth is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.evaluation.score_frame import Score
from frictionid.friction import Friction
from frictionid.friction.laws import Ensemble, members_of

POINTS = 401
_SLOW, _SHARE = 0.05, 0.01  # [rad/s], and of the speeds of slower joints


def velocity_grid(w: Array) -> Array:
    """401 uniform velocities on +-q95 of |w| of each joint, shape (401, n); w (K, n) [rad/s]."""
    q95 = np.quantile(np.abs(w), 0.95, axis=0)
    return np.linspace(-q95, q95, POINTS)


def slow_speed(fast: Array) -> Array:
    """Speeds below which the smoothing of sgn(w) is compared, not friction [rad/s].

    0.05 rad/s, or 1 % of the 95 % quantile `fast` of the speeds of slower joints.

    >>> slow_speed(np.array([12.0, 0.5]))
    array([0.05 , 0.005])
    """
    return np.asarray(np.minimum(_SLOW, _SHARE * fast))


def curves(friction: Friction, grid: Array) -> Array:
    """Steady-state torque of each joint on its own velocity grid (V, n): (..., V, n) [N m]."""
    joints = [friction.curve(grid[:, j])[..., j] for j in range(friction.n)]
    return np.stack(joints, axis=-1)


def member_curves(friction: Friction, grid: Array) -> Array:
    """Curves (N, V, n) of the N members of an ensemble on the grid (V, n) [N m]; else (0, V, n)."""
    if not isinstance(friction.law, Ensemble):
        return np.empty((0, *grid.shape))
    return curves(members_of(friction), grid)


def curve_error(estimate: Array, truth: Array, grid: Array) -> Array:
    """RMS(estimate - truth)/RMS(truth) of each joint, shape (..., n), without slow speeds.

    estimate (..., V, n), truth and grid (V, n); see `slow_speed`. NaN for joints that hardly move
    or rub.

    >>> grid = velocity_grid(np.linspace(-5, 5, 100)[:, None])
    >>> curve_error(1.1 * grid, grid, grid).round(3)
    array([0.1])
    """
    use = (np.abs(grid) >= slow_speed(np.abs(grid).max(axis=0))).astype(float)
    off = (((estimate - truth) ** 2) * use).sum(-2)
    size = ((truth**2) * use).sum(-2)
    return np.sqrt(off / np.where(size > 0, size, np.nan))


def curve_scores(errors: Array, overall: Array) -> Iterator[Score]:
    """Scores of curve errors: (F, n) of the folds, and (n,) of the friction fitted to all data.

    Joints without a curve error have no score.
    """
    for fold, error in [*((str(f), e) for f, e in enumerate(errors)), ("all", overall)]:
        for j in np.flatnonzero(np.isfinite(error)):
            yield Score(fold, "curve_error", "rms", joint=str(j + 1), value=float(error[j]))


def with_speeds(friction: Friction, w: Array) -> Friction:
    """Friction whose provenance has the greatest speed of each part in the data, from w (K, m)."""
    reach = [float(f"{speed:.6g}") for speed in np.abs(w).max(axis=0)]
    return replace(friction, provenance={**friction.provenance, "speeds": reach})


def known_speeds(friction: Friction) -> tuple[float, ...]:
    """Greatest speed of each part in the data, as `with_speeds` wrote it; () where none is known.

    Raises
    ------
    InputError
        Where the provenance of a model file holds something else.
    """
    given = friction.provenance.get("speeds") or ()
    try:
        known = tuple(float(v) for v in given)
    except (TypeError, ValueError):
        known = (np.nan,)
    if not np.isfinite(known).all():
        raise InputError(f"provenance.speeds of the model must be speeds [rad/s], not {given!r}")
    return known
