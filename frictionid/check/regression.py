"""Inverse-dynamics least squares: base parameters, Coulomb, viscous and offset of each joint.

One balance per window and joint (see `rows`), torque alone on the left:

    B u = phi p + coulomb sgn(w) + viscous w + offset     [N m]

Windows in which a joint rests or turns round say nothing of its sliding friction and are left out of
its own balance, as in `problem.sliding`; in the torque balance another joint's friction does not
appear. [Gautier1990]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.rows import Rows

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


def regress(
    rows: Rows,
    torque: Array,
    base_names: Sequence[str],
    told: Array,
    scale: Array | None = None,
) -> Estimate:
    """Base parameters and friction of all joints from the rows.

    Parameters
    ----------
    rows : Rows, K windows of n joints
    torque : array, shape (K, n) [N m], zero where there is no motor
    base_names : names of the nb base parameters
    told : array, shape (R, nb); recordings may differ by known amounts (an exchangeable mass): the
        first recording's values are estimated, the differences are taken as told
    scale : array, shape (nb,), optional; what counts as a large change of each base parameter

    Columns that are zero in all rows (gravity of a horizontal axis) get the value told, with an
    infinite error.
    """
    n, nb = rows.inertia.shape[1:]
    free = rows.free
    reference = np.asarray(told, float)[0]
    difference = (np.asarray(told, float) - reference)[rows.recording]
    y = torque - (rows.phi * difference[:, None]).sum(-1)
    X = design(rows)
    names = (*base_names, *(f"{f}_{j + 1}" for j in range(n) for f in FRICTION))
    alive = (np.abs(X) > 1e-12).any(1).any(0) & np.append(np.ones(nb, bool), _seen(rows))
    at = np.flatnonzero(alive)
    size = _sizes(rows, torque, reference if scale is None else np.asarray(scale, float))
    fixed = np.where(alive, 0.0, np.append(reference, np.zeros(3 * n)))
    part = _solve(X[..., at], y - X @ fixed, rows, size[at])
    value, covariance = fixed, np.full((len(names), len(names)), np.nan)
    value[at] = part.value
    covariance[np.ix_(at, at)] = part.covariance
    error = np.full(len(names), np.inf)
    error[at] = np.sqrt(np.maximum(np.diag(part.covariance), 0.0))
    residual = np.where(rows.free, y - X @ value, np.nan)
    blind = tuple(
        tuple((names[at[i]], float(v[i])) for i in np.argsort(-np.abs(v)) if abs(v[i]) > 0.2)
        for v in part.blind
    )
    return Estimate(names, value, error, covariance, residual, _spread(residual, free), blind)


def design(rows: Rows) -> Array:
    """Columns of base parameters and of each joint's Coulomb, viscous and offset, (K, n, P)."""
    K, n, nb = rows.inertia.shape
    own = rows.friction[..., : len(FRICTION)]
    X = np.zeros((K, n, nb + 3 * n))
    X[..., :nb] = rows.phi
    for j in range(n):
        X[:, j, nb + 3 * j : nb + 3 * j + 3] = own[:, j]
    return X


def block_numbers(rows: Rows) -> Array:
    """Number of the block of like errors that each row belongs to, (K,)."""
    if len(np.unique(rows.recording)) >= MANY:
        return rows.recording
    block = np.floor(rows.start / BLOCK).astype(int)
    key = rows.recording * (int(block.max()) + 1) + (block - block.min())
    return np.unique(key, return_inverse=True)[1]


def sandwich(X: Array, residual: Array, block: Array, inverse: Array) -> Array:
    """Covariance of least squares with errors alike within blocks, (P, P) [LiangZeger1986].

    X (N, P), residual (N,), block (N,), inverse: (X'X)^-1.
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
        Aw, bw = A * weight[:, None], b * weight
        U, s, V = np.linalg.svd(Aw, full_matrices=False)
        kept = s > 1e-7 * s[0]
        x = V[kept].T @ ((U[:, kept].T @ bw) / s[kept])
        residual = b - A @ x
        full = np.zeros(free.shape)
        full[free] = residual
        spread = _spread(full, free)
    inverse = (V[kept].T / s[kept] ** 2) @ V[kept]
    covariance = sandwich(Aw, residual * weight, block, inverse)
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
    fast = np.maximum(np.abs(rows.w).max(0), 1e-12)
    friction = np.stack([level, level / fast, level], axis=-1) * 0.2
    small = 1e-3 * np.abs(base).max()
    return np.concatenate([np.maximum(np.abs(base), small), friction.ravel()])


def _spread(values: Array, free: Array) -> Array:
    """Root mean square (n,) over the rows of each joint that count."""
    squares = np.where(free, values, 0.0) ** 2
    return np.sqrt(squares.sum(0) / np.maximum(free.sum(0), 1))
