"""Friction curves over velocity, and their error where the truth is known."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, rms, solve
from frictionid.data.plants import Calibration
from frictionid.data.recordings import Dataset
from frictionid.data.signals import LARGEST
from frictionid.errors import InputError
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction import Friction, at_rest
from frictionid.friction.laws import FilmLag, LuGre, Stribeck

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
    return np.minimum(_SLOW, _SHARE * fast)


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


def curve_scores(errors: Array) -> Iterator[Score]:
    """Scores of curve errors (F + 1, n): of the folds and, last, of the friction of all data."""
    for fold, error in zip((*map(str, range(len(errors) - 1)), "all"), errors, strict=True):
        for j in np.flatnonzero(np.isfinite(error)):
            yield Score(fold, "curve_error", "rms", joint=str(j + 1), value=float(error[j]))


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
    table = (dataset.truth or {}).get("rig")
    if not isinstance(table, Mapping):
        return None
    mechanism, parameters = dataset.mechanism, table.get("parameters") or {}
    gain, delay = float(table.get("torque_gain", 1.0)), float(table.get("torque_delay", 0.0))
    if not parameters and gain == 1.0 and delay == 0.0:
        return None
    ideal = Calibration.ideal(mechanism.n, mechanism.base(mechanism.nominal(parameters)))
    return replace(ideal, gain=gain * ideal.gain, delay=np.array(delay))


# --- Physical plausibility ------------------------------------------------------------------------


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
    return Beyond(velocity, np.asarray(friction.curve(velocity)), np.stack(whole, axis=1))


def lowest_dissipation(velocity: Array, torque: Array) -> Array:
    """Lowest torque against the motion, share of its RMS (..., n); negative where it drives.

    velocity (V, n), torque (..., V, n), without slow velocities (`slow_speed`).

    >>> w = np.linspace(-2.0, 2.0, 401)[:, None]
    >>> lowest_dissipation(w, 0.3 * np.sign(w) - 0.2 * w).round(2)  # drives above 1.5 rad/s
    array([-0.66])
    """
    use = np.abs(velocity) >= slow_speed(np.abs(velocity).max(axis=0))
    against = np.where(use, torque * np.sign(velocity), np.inf).min(axis=-2)
    return against / torque_size(torque)


def asymmetry(velocity: Array, torque: Array) -> Array:
    """Half the sum of both directions' torques, share of its RMS (..., n); velocity symmetric.

    >>> w = np.linspace(-2.0, 2.0, 401)[:, None]
    >>> asymmetry(w, np.where(w > 0, 1.1, -0.9)).round(2)
    array([0.1])
    """
    half = len(velocity) // 2
    both = 0.5 * (torque[..., ::-1, :][..., :half, :] + torque[..., :half, :])
    return both.mean(axis=-2) / torque_size(torque)


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
    return np.maximum(*drops) / torque_size(torque)


def cycle_work(velocity: Array, torque: Array) -> Array:
    """Work of a torque (..., T) over a closed cycle of the velocity (T,), evenly sampled.

    Share of what its RMS would dissipate, negative where the cycle gives energy.

    >>> w = np.sin(np.linspace(0, 2 * np.pi, 200, endpoint=False))
    >>> cycle_work(w, 0.2 * np.sign(w)).round(2), cycle_work(w, -0.2 * w).round(2)
    (np.float64(1.0), np.float64(-1.11))
    """
    size = rms(torque, -1)
    most = np.where(size > 0, size, np.inf) * np.mean(np.abs(velocity))
    return np.mean(torque * velocity, axis=-1) / most


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
    return problem.dt[use] * (w * torque).sum(axis=-1)


def torque_size(torque: Array) -> Array:
    """Root mean square over the velocities (..., n); infinite where there is no torque."""
    size = rms(torque, -2)
    return np.where(size > 0, size, np.inf)
