"""Inverse-dynamics least squares: base parameters, Coulomb, viscous and offset of each joint.

One balance per window and joint (see `rows`), torque alone on the left:

    B u = phi p + coulomb sgn(w) + viscous w + offset     [N m]

Windows in which a joint rests say nothing of its sliding friction and are left out of its own
balance, as in `problem.sliding`; so are those in which it turns round, unless the motion is seen
sharply enough (`rows.sharp_rows`). In the torque balance another joint's friction does not appear.
[Gautier1990]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows

FRICTION = ("coulomb", "viscous", "offset")
# Errors are alike within a swing: this long a stretch [s] counts as one observation, or a whole
# recording where there are at least this many.
BLOCK, MANY = 1.0, 10
# A direction in which the standard error exceeds this share of the parameters' sizes is not seen.
BLIND = 0.3


class Estimate(NamedTuple):
    """Least-squares estimate with standard errors.

    names (P,) ; value, error (P,) SI ; covariance (P, P) ; residual (K, n) [N m], NaN where left
    out ; spread (n,) [N m] RMS residual of each joint ; blind: unidentifiable directions, each a
    list of (name, share) where share is the change in units of the parameter's scale
    """

    names: tuple[str, ...]
    value: Array
    error: Array
    covariance: Array
    residual: Array
    spread: Array
    blind: tuple[tuple[tuple[str, float], ...], ...]

    def at(self, name: str) -> tuple[float, float]:
        """Value and standard error of a parameter."""
        i = self.names.index(name)
        return float(self.value[i]), float(self.error[i])


def regress(rows: Rows, torque: Array, base_names: Sequence[str], told: Array) -> Estimate:
    """Base parameters and friction of all joints from the rows.

    The errors are those of errors alike within blocks. They also hold two systematic ones: how far
    the value moves when the friction at low speed is left open (a Stribeck peak that Coulomb and
    viscous friction miss), and how much smaller all values may look because the motion, on the
    right side, has errors too: by the remainder's share of the torque's squares.

    Parameters
    ----------
    rows : Rows with unit parameter vectors, K windows of n joints
    torque : array, shape (K, n) [N m], zero where there is no motor
    base_names : names of the nb base parameters
    told : array, shape (R, nb)
        Recordings may differ by known amounts (an exchangeable mass): the first recording's values
        are estimated, the differences are taken as told.

    What cannot be estimated keeps the value told (friction: 0), with an infinite error: base
    parameters that do not appear (gravity of a horizontal axis), friction of a joint that hardly
    slides and, where no torque acts, the largest base parameter, because only ratios show then.
    """
    n, nb = rows.inertia.shape[1:]
    reference = np.asarray(told, float)[0]
    difference = (np.asarray(told, float) - reference)[rows.recording]
    y = torque - (rows.phi * difference[:, None]).sum(-1)
    names = (*base_names, *(f"{f}_{j + 1}" for j in range(n) for f in FRICTION))
    X = np.concatenate([rows.phi, _friction_columns(rows, slice(len(FRICTION)))], axis=-1)
    size, alive = _sizes(rows, torque, reference), _alive(X, rows, torque, reference)
    value = np.where(alive, 0.0, np.append(reference, np.zeros(3 * n)))
    at = np.flatnonzero(alive)
    y = y - X @ value
    if not len(at):
        unknown = np.full(len(names), np.inf)
        residual = np.where(rows.free, y, np.nan)
        spread = _spread(y, rows.free)
        return Estimate(names, value, unknown, np.diag(unknown), residual, spread, ())
    part = _solve(X[..., at], y, rows, size[at])
    drift = part.value - _open_value(X[..., at], y, rows, size[at])
    value[at] = part.value
    covariance = np.full((len(names), len(names)), np.nan)
    shrunk = _shrinkage(torque, y - X[..., at] @ part.value, rows.free) * part.value
    covariance[np.ix_(at, at)] = part.covariance + np.outer(drift, drift) + np.outer(shrunk, shrunk)
    error = np.full(len(names), np.inf)
    error[at] = np.sqrt(np.maximum(np.diag(covariance)[at], 0.0))
    residual = np.where(rows.free, y - X[..., at] @ part.value, np.nan)
    blind = tuple(
        tuple((names[at[i]], float(v[i])) for i in np.argsort(-np.abs(v)) if abs(v[i]) > 0.2)
        for v in part.blind
    )
    return Estimate(names, value, error, covariance, residual, _spread(residual, rows.free), blind)


def _shrinkage(torque: Array, residual: Array, free: Array) -> float:
    """Mean square of the remainder over that of the torque, of the joints with torque."""
    power, left = _spread(torque, free) ** 2, _spread(residual, free) ** 2
    acts = power > 0
    return float(min(left[acts].sum() / power[acts].sum(), 1.0)) if acts.any() else 0.0


def _friction_columns(rows: Rows, shapes: slice) -> Array:
    """Columns of friction shapes, those of each joint in its own balance only, (K, n, n F)."""
    own = rows.friction[..., shapes]
    K, n, F = own.shape
    out = np.zeros((K, n, n, F))
    each = np.arange(n)
    out[:, each, each] = own[:, each]
    return out.reshape(K, n, n * F)


def _open_value(X: Array, y: Array, rows: Rows, size: Array) -> Array:
    """Estimate with the shapes of slow friction as further columns."""
    slow = _friction_columns(rows, slice(len(FRICTION), None))
    slow = slow[..., (np.abs(slow[rows.free.any(1)]) > 0).any((0, 1))]
    level = np.full(slow.shape[-1], size[-1] if len(size) else 1.0)
    wide = np.concatenate([X, slow], axis=-1)
    value: Array = _solve(wide, y, rows, np.append(size, level)).value[: X.shape[-1]]
    return value


def _alive(X: Array, rows: Rows, torque: Array, reference: Array) -> Array:
    """Whether each parameter can be estimated at all."""
    alive = (np.abs(X[rows.free]) > 1e-12).any(0)
    alive[len(reference) :] &= _seen(rows)
    if not np.abs(torque).any():
        terms = (rows.phi[rows.free] * reference) ** 2
        alive[int(np.argmax(terms.sum(0)))] = False
    return alive


def block_numbers(rows: Rows) -> Array:
    """Number of the block of like errors that each row belongs to, (K,)."""
    if len(np.unique(rows.recording)) >= MANY:
        return rows.recording
    block = np.floor(rows.start / BLOCK).astype(int)
    key = rows.recording * (int(block.max()) + 1) + (block - block.min())
    return np.unique(key, return_inverse=True)[1]


def sandwich(X: Array, residual: Array, block: Array, inverse: Array) -> Array:
    """Covariance of least squares with errors alike within blocks, (P, P).

    X (N, P), residual (N,), block (N,), inverse: (X'X)^-1. The sandwich of Liang and Zeger, 1986.
    """
    scores = np.zeros((int(block.max()) + 1, X.shape[1]))
    np.add.at(scores, block, X * residual[:, None])
    used = len(np.unique(block))
    # two thirds of the lost degrees of freedom fall on few blocks; the usual small-sample factor
    factor = used / max(used - 1, 1) * (len(X) - 1) / max(len(X) - X.shape[1], 1)
    return factor * inverse @ (scores.T @ scores) @ inverse


class _Solved(NamedTuple):
    value: Array
    covariance: Array
    blind: Array


def _solve(X: Array, y: Array, rows: Rows, size: Array) -> _Solved:
    """Least squares in which each joint weighs by its own residual, found in three rounds."""
    free = rows.free
    block = np.broadcast_to(block_numbers(rows)[:, None], free.shape)[free]
    joint = np.broadcast_to(np.arange(free.shape[1]), free.shape)[free]
    A, b = X[free] * size, y[free]
    spread = _spread(np.where(free, (np.abs(X) * size).max(-1), 0.0), free)
    for _ in range(3):
        weight = 1.0 / np.where(spread > 0, spread, 1.0)[joint]
        weighted, target = A * weight[:, None], b * weight
        U, s, V = np.linalg.svd(weighted, full_matrices=False)
        kept = s > 1e-7 * s[0]
        x = V[kept].T @ ((U[:, kept].T @ target) / s[kept])
        residual = b - A @ x
        full = np.zeros(free.shape)
        full[free] = residual
        spread = _spread(full, free)
    inverse = (V[kept].T / s[kept] ** 2) @ V[kept]
    covariance = sandwich(weighted, residual * weight, block, inverse)
    return _Solved(x * size, covariance * np.outer(size, size), _blind(covariance, V[~kept]))


def _blind(covariance: Array, lost: Array) -> Array:
    """Directions, in units of the parameters' sizes, whose standard error exceeds BLIND."""
    variance, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return np.concatenate([lost, vectors.T[variance > BLIND**2]])


def _seen(rows: Rows) -> Array:
    """Whether each joint slides often enough for its three friction numbers, (3 n,)."""
    return np.repeat(rows.free.sum(0) >= 10, len(FRICTION))


def _sizes(rows: Rows, torque: Array, base: Array) -> Array:
    """What counts as one of each parameter: its own size, or the joint's typical torque."""
    mean = (rows.phi * base).sum(-1)
    level = np.maximum(_spread(mean, rows.free), _spread(torque, rows.free))
    level = np.where(level > 0, level, 1.0)
    fast = np.maximum(np.abs(rows.w).max(0, initial=0.0), 1e-12)
    friction = np.stack([level, level / fast, level], axis=-1) * 0.2
    small = 1e-3 * np.abs(base).max()
    return np.concatenate([np.maximum(np.abs(base), small), friction.ravel()])


def _spread(values: Array, free: Array) -> Array:
    """Root mean square (n,) over the rows of each joint that count."""
    squares = np.where(free, values, 0.0) ** 2
    return np.sqrt(squares.sum(0) / np.maximum(free.sum(0), 1))
