"""Friction curves over velocity, and their error where the truth is known."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.data.recordings import Dataset
from frictionid.data.signals import LARGEST
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.friction.laws import Ensemble, FilmLag, LuGre, Stribeck, members_of

from .score_frame import Score

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
    return friction.noted({"speeds": tuple(reach)})


# The law of each kind of truth, and what its table has besides the steady-state curve. Stribeck
# velocities and what follows stand in the order of the law's parameters.
MODELS: Mapping[str, tuple[Any, tuple[str, ...]]] = {
    "stribeck": (Stribeck(symmetric=False), ()),
    "film_lag": (FilmLag(symmetric=False), ("lag",)),
    "lugre": (LuGre(symmetric=False), ("bristle_stiffness", "bristle_damping", "damping_velocity")),
}


def steady_state(truth: Mapping[str, Any], width: float = 1e-6) -> Friction:
    """True steady-state friction: the curve that every kind of truth follows at constant speed.

    Raises
    ------
    InputError
        Where the table does not hold one finite number for each parameter and joint.
    """
    law = Stribeck(width=width, symmetric=False)
    theta = _columns(truth, law.names, np.size(truth.get(law.names[0], ())))
    return Friction(law, theta).noted({"source": "truth"})


def _columns(truth: Mapping[str, Any], names: Sequence[str], joints: int) -> Array:
    """Numbers of the table, shape (joints, names)."""
    missing = [name for name in names if name not in truth]
    if missing:
        raise InputError(f"[truth] lacks {', '.join(missing)}")
    for name in names:
        if np.shape(truth[name]) != (joints,) or not _numbers(truth[name]):
            raise InputError(f"[truth] {name} = {truth[name]!r} must be one number for each joint")
    columns = np.array([truth[name] for name in names], dtype=float)
    return columns.reshape(len(names), joints).T


def _numbers(values: Any) -> bool:
    if not isinstance(values, list | tuple) or not values:
        return False
    plain = {type(value) for value in values} <= {int, float}
    return plain and all(abs(value) < LARGEST for value in values)


def true_friction(truth: Mapping[str, Any]) -> Friction | None:
    """True friction as a model that can be scored; None for a kind that is none of our laws.

    Raises
    ------
    InputError
        Where the table does not hold one finite number for each parameter and joint.
    """
    if truth.get("kind") not in MODELS:
        return None
    law, names = MODELS[truth["kind"]]
    curve = steady_state(truth, law.width)
    columns = _columns(truth, names, curve.n)
    if isinstance(law, LuGre):
        if not (columns > 0)[:, [0, 2]].all():
            raise InputError("[truth] bristle_stiffness and damping_velocity must be positive")
        # bristles have a stiffness here, in the law a bend at the mean break-away level
        columns[..., 0] = curve.theta[..., :4].sum(-1) / 2 / columns[..., 0]
    return replace(curve, law=law, theta=np.concatenate([curve.theta, columns], axis=-1))


def true_calibration(dataset: Dataset) -> Calibration | None:
    """True base parameters, gain and delay of simulated data; None where the nominal are true."""
    table: Any = (dataset.truth or {}).get("rig")
    if not isinstance(table, Mapping):
        return None
    mechanism, parameters = dataset.mechanism, table.get("parameters") or {}
    gain, delay = float(table.get("torque_gain", 1.0)), float(table.get("torque_delay", 0.0))
    if not parameters and gain == 1.0 and delay == 0.0:
        return None
    ideal = Calibration.ideal(mechanism.n, mechanism.base(mechanism.nominal(parameters)))
    return replace(ideal, gain=gain * ideal.gain, delay=np.array(delay))
