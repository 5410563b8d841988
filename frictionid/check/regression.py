"""Inverse-dynamics least squares: base parameters, Coulomb, viscous and offset of each joint.

One balance per window and joint (see `balance_windows`), torque alone on the left:

    B u = regressor p + coulomb sgn(w) + viscous w + offset     [N m]

Parts that turn with several joints have Coulomb and viscous friction of their own, in the balances
of these joints.

Windows in which a joint rests show nothing of its sliding friction and are left out of its own
balance, as by the stiction mask of `identifiers.residual`; so are those in which it reverses,
unless the motion is sharp enough (`adaptive_rows`). In the torque balance another joint's friction
does not appear. [Gautier1990]
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.one_step.balances import PART_SHAPES, SHAPE_NAMES, Rows
from frictionid.mechanics import Mechanism

from .motion import Measured

FRICTION, SLOW = ("coulomb", "viscous", "offset"), ("slow", "slower")
# Errors are correlated within a swing: this long a block [s] counts as one observation, or a whole
# recording where there are at least this many.
BLOCK, MANY = 1.0, 10
# A direction whose standard error exceeds this share of the parameters' sizes is unidentifiable.
UNIDENTIFIABLE = 0.3


class Estimate(NamedTuple):
    """Least-squares estimate with standard errors.

    names (P,) ; value, error (P,) SI ; covariance (P, P) ; residual (K, n) [N m], NaN where left
    out ; spread (n,) [N m] RMS residual of each joint ; unidentifiable: directions, each a list of
    (name, share) where share is the change in units of the parameter's scale
    """

    names: tuple[str, ...]
    value: Array
    error: Array
    covariance: Array
    residual: Array
    spread: Array
    unidentifiable: tuple[tuple[tuple[str, float], ...], ...]

    def at(self, name: str) -> tuple[float, float]:
        """Value and standard error of a parameter."""
        i = self.names.index(name)
        return float(self.value[i]), float(self.error[i])


@dataclass(frozen=True, eq=False)
class Regression:
    """Corrected data of the least squares; rows and their mean torques (K, n) [N m]."""

    measured: Measured
    rows: Rows
    torque: Array


def regress(rows: Rows, torque: Array, mechanism: Mechanism, nominal: Array) -> Estimate:
    """Base parameters and friction of all joints from the rows.

    The errors allow for correlation within blocks, and hold systematic ones: how far the value
    moves when the friction at low speed is free (a Stribeck peak that Coulomb and viscous friction
    miss), how far base parameters move when friction may grow with the motor's torque, and the
    attenuation by errors of the motion, which is a regressor: the values times the residual's share
    of the torque's squares.

    Parameters
    ----------
    rows : Rows with unit parameter vectors, K windows of n joints
    torque : array, shape (K, n) [N m], zero where there is no motor
    mechanism : names its nb base parameters and the parts that turn with several joints
    nominal : array, shape (R, nb)
        Recordings may differ by known amounts (an exchangeable mass): the first recording's values
        are estimated, the differences are taken as given.

    What cannot be estimated keeps its nominal value (friction: 0), with an infinite error: base
    parameters that do not appear (gravity of a horizontal axis), friction of a joint that hardly
    slides and, where no torque acts, the largest base parameter, because only ratios show then.
    """
    reference = nominal[0]
    names = (*mechanism.base_names, *friction_names(mechanism))
    X = np.concatenate([rows.regressor, friction_columns(rows, FRICTION)], axis=-1)
    size, estimable = _sizes(rows, torque, reference), _estimable(X, rows, torque, reference)
    value = np.where(estimable, 0.0, np.append(reference, np.zeros(len(names) - len(reference))))
    at = np.flatnonzero(estimable)
    y = torque - rows.required(nominal - reference) - X @ value
    covariance = np.full((len(names), len(names)), np.nan)
    error = np.full(len(names), np.inf)
    unidentifiable: tuple[tuple[tuple[str, float], ...], ...] = ()
    if len(at):
        equations = X[..., at], y, rows, size[at]
        fitted, of_noise, directions = _solved(*equations)
        value[at], y = fitted, y - X[..., at] @ fitted
        drifts = [
            *_drifts(equations, fitted, torque, at < len(reference)),
            _attenuation(torque, y, rows.moving) * fitted,
        ]
        covariance[np.ix_(at, at)] = of_noise + sum(np.outer(d, d) for d in drifts)
        error[at] = np.sqrt(np.maximum(np.diag(covariance)[at], 0.0))
        unidentifiable = tuple(_named(v, [names[i] for i in at]) for v in directions)
    else:
        covariance = np.diag(error)
    residual = np.where(rows.moving, y, np.nan)
    spread = row_rms(y, rows.moving)
    return Estimate(names, value, error, covariance, residual, spread, unidentifiable)


# Balances of the rows, X x = y [N m], with what counts as one of each parameter: X (K, n, P),
# y (K, n), the rows, and sizes (P,).
_Equations = tuple[Array, Array, Rows, Array]


def _drifts(equations: _Equations, value: Array, torque: Array, is_base: Array) -> list[Array]:
    """How far the estimates (P,) move where friction is free at low speed, or grows with a torque.

    is_base (P,) : of base parameters, the only ones that friction growing with the torque moves
    """
    rows = equations[2]
    slowly, _ = _beside(equations, friction_columns(rows, SLOW))
    # of each joint, in its own balance only
    loaded = (np.abs(torque) * rows.friction[..., 0])[..., None] * np.eye(torque.shape[1])
    growing, covariance = _beside(equations, loaded)
    error = np.sqrt(np.diag(covariance))
    grown = np.where(is_base, _beyond(value - growing, error), 0.0)
    return [value - slowly, grown]


def _named(direction: Array, names: Sequence[str]) -> tuple[tuple[str, float], ...]:
    """Parameters of a direction with their shares, the largest first; small ones are left out."""
    order = np.argsort(-np.abs(direction))
    return tuple((names[i], float(direction[i])) for i in order if abs(direction[i]) > 0.2)


def _attenuation(torque: Array, residual: Array, moving: Array) -> float:
    """Mean square of the residual over that of the torque, of the joints with torque."""
    power, left = row_rms(torque, moving) ** 2, row_rms(residual, moving) ** 2
    acts = power > 0
    return float(min(left[acts].sum() / power[acts].sum(), 1.0)) if acts.any() else 0.0


def friction_columns(rows: Rows, shapes: Sequence[str] = SHAPE_NAMES) -> Array:
    """Columns of friction shapes: of each joint in its own balance only, then of coupled parts.

    Shape (K, n, n F + c f), see `friction_names`.
    """
    joints = rows.friction[..., [SHAPE_NAMES.index(shape) for shape in shapes]]
    parts = rows.coupled[..., [PART_SHAPES.index(s) for s in shapes if s in PART_SHAPES]]
    (K, n, F), (c, f) = joints.shape, parts.shape[2:]
    out = np.zeros((K, n, n, F))
    each = np.arange(n)
    out[:, each, each] = joints[:, each]
    return np.concatenate([out.reshape(K, n, n * F), parts.reshape(K, n, c * f)], axis=-1)


def friction_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the friction parameters: of joints by their numbers, of coupled parts by name."""
    joints = [f"{shape}_{j + 1}" for j in range(mechanism.n) for shape in FRICTION]
    parts = [f"{shape}_{name}" for name, _ in mechanism.coupled for shape in FRICTION[:2]]
    return (*joints, *parts)


def widened(estimate: Estimate, longer: Estimate) -> Estimate:
    """The estimate with what longer windows change of it as a further systematic error.

    Errors of the motion weigh less in these. What their own errors explain is left out.
    """
    both = np.isfinite(estimate.error) & np.isfinite(longer.error)
    drift = np.where(both, longer.value - estimate.value, 0.0)
    drift = _beyond(drift, np.where(both, longer.error, 0.0))
    covariance = estimate.covariance + np.outer(drift, drift)
    return estimate._replace(covariance=covariance, error=np.hypot(estimate.error, drift))


def _beyond(drift: Array, error: Array) -> Array:
    """The part of a drift that its standard error does not explain."""
    return np.sign(drift) * np.sqrt(np.maximum(drift**2 - error**2, 0.0))


def _estimable(X: Array, rows: Rows, torque: Array, reference: Array) -> Array:
    """Whether each parameter can be estimated at all."""
    out: Array = np.any(np.abs(X[rows.moving]) > 1e-12, axis=0)
    slides = np.repeat(rows.moving.sum(0) >= 10, len(FRICTION))
    out[len(reference) : len(reference) + len(slides)] &= slides
    if not torque.any():
        terms = (rows.regressor[rows.moving] * reference) ** 2
        out[int(np.argmax(terms.sum(0)))] = False
    return out


def block_numbers(rows: Rows) -> Array:
    """Number of the block of correlated errors of each balance that counts, (N,)."""
    number = rows.recording
    if len(np.unique(number)) < MANY:
        block = np.floor(rows.start / BLOCK).astype(int)
        key = number * (int(block.max()) + 1) + (block - block.min())
        number = np.unique(key, return_inverse=True)[1]
    return np.broadcast_to(number[:, None], rows.moving.shape)[rows.moving]


def sandwich(X: Array, residual: Array, block: Array, inverse: Array) -> Array:
    """Covariance of least squares with errors correlated within blocks, (P, P).

    X (N, P), residual (N,), block (N,), inverse: (X'X)^-1. The sandwich of Liang and Zeger, 1986.
    """
    scores = np.zeros((int(block.max()) + 1, X.shape[1]))
    np.add.at(scores, block, X * residual[:, None])
    used = len(np.unique(block))
    # two thirds of the lost degrees of freedom fall on few blocks; the usual small-sample factor
    factor = used / max(used - 1, 1) * (len(X) - 1) / max(len(X) - X.shape[1], 1)
    return factor * inverse @ (scores.T @ scores) @ inverse


def _beside(equations: _Equations, columns: Array) -> tuple[Array, Array]:
    """Estimates (P,) with further columns (K, n, m) beside them, and their covariance (P, P)."""
    X, y, rows, size = equations
    columns = columns[..., (np.abs(columns[rows.moving.any(1)]) > 0).any((0, 1))]
    level = np.full(columns.shape[-1], size[-1])
    X = np.concatenate([X, columns], axis=-1)
    value, covariance, _ = _solved(X, y, rows, np.append(size, level))
    P = len(size)
    return value[:P], covariance[:P, :P]


def _solved(X: Array, y: Array, rows: Rows, size: Array) -> tuple[Array, Array, Array]:
    """Least squares (P,) in which each joint is weighted by its own residual, in three rounds.

    With the covariance (P, P), and the directions that are unidentifiable, one in each row.
    """
    moving = rows.moving
    joint = np.broadcast_to(np.arange(moving.shape[1]), moving.shape)[moving]
    A, b = X[moving] * size, y[moving]
    spread = row_rms((np.abs(X) * size).max(-1), moving)
    for _ in range(3):
        weight = 1.0 / np.where(spread > 0, spread, 1.0)[joint]
        weighted, target = A * weight[:, None], b * weight
        U, s, V = np.linalg.svd(weighted, full_matrices=False)
        kept = s > 1e-7 * s[0]
        x = V[kept].T @ ((U[:, kept].T @ target) / s[kept])
        residual = b - A @ x
        full = np.zeros(moving.shape)
        full[moving] = residual
        spread = row_rms(full, moving)
    inverse = (V[kept].T / s[kept] ** 2) @ V[kept]
    covariance = sandwich(weighted, residual * weight, block_numbers(rows), inverse)
    covariance += V[~kept].T @ V[~kept]  # what no row tells is of any usual size
    variance, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    directions = vectors.T[variance > UNIDENTIFIABLE**2]
    return x * size, covariance * np.outer(size, size), directions


def _sizes(rows: Rows, torque: Array, base: Array) -> Array:
    """What counts as one of each parameter: its own size, or the joint's typical torque."""
    mean = (rows.regressor * base).sum(-1)
    level = np.maximum(row_rms(mean, rows.moving), row_rms(torque, rows.moving))
    level = np.where(level > 0, level, 1.0)
    fast = np.maximum(np.abs(rows.w).max(0, initial=0.0), 1e-12)
    friction = np.stack([level, level / fast, level], axis=-1) * 0.2
    # a coupled part: as the joints on which it acts
    turns = np.abs(rows.coupled[..., :2])  # Coulomb and viscous, as `FRICTION` begins
    parts = 0.2 * level.max() / np.maximum(turns.max((0, 1), initial=0.0), 1e-12)
    small = 1e-3 * np.abs(base).max()
    # a nominal zero (no gravity) counts by the torque that it would make
    column = np.abs(np.where(rows.moving[..., None], rows.regressor, 0.0)).max((0, 1), initial=0.0)
    alone = 0.2 * level.max() / np.where(column > 0, column, 1.0)
    sizes = np.maximum(np.where(base == 0.0, alone, np.abs(base)), small)
    return np.concatenate([sizes, friction.ravel(), parts.ravel()])


def unit_columns(columns: Array) -> tuple[Array, Array]:
    """Columns (N, P) of unit size, those of zeros as they are, and what they were divided by (P,).

    >>> unit_columns(np.array([[3.0, 0.0], [4.0, 0.0]]))[1]
    array([5., 1.])
    """
    size = np.sqrt((columns**2).sum(axis=0))
    size = np.where(size > 0, size, 1.0)
    return columns / size, size


def row_rms(values: Array, moving: Array) -> Array:
    """Root mean square (n,) over the rows of each joint that count."""
    squares = np.where(moving, values, 0.0) ** 2
    return np.sqrt(squares.sum(0) / np.maximum(moving.sum(0), 1))


# Mean of sgn(w) beyond which a window counts as motion in one direction.
ONE_WAY = 0.999


def one_way(rows: Rows, j: int) -> Array:
    """Windows (K,) in which joint j moves in one direction: there friction has a speed."""
    return rows.moving[:, j] & (np.abs(rows.friction[:, j, 0]) > ONE_WAY)
