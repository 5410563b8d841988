"""One suspected error at a time, fitted together with all that may be unknown anyway.

Rows of all joints are stacked and weighted; the *nuisance* columns (free friction and, for some
questions, moderate changes of the mechanism) are projected out once, after which a suspect is a
regression on one column.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows
from frictionid.check.regression import block_numbers

# The mechanism's parameters may be off by this share where they are a nuisance.
LOOSE = 0.3
# Share of its terms that a balance usually fails by.
MODEL = 0.02


class Stack(NamedTuple):
    """Weighted rows without what the nuisance explains.

    free (K, n) : which joints of which rows count; weight (n,) [1/(N m)]; Q (N, P) : orthonormal
    basis of the nuisance; block (N,) : like errors
    """

    free: Array
    weight: Array
    Q: Array
    block: Array
    extra: int

    def clean(self, torque: Array) -> Array:
        """Weighted torques (..., K, n) without their nuisance part, (..., N)."""
        flat = (torque * self.weight)[..., self.free]
        flat = np.concatenate([flat, np.zeros((*flat.shape[:-1], self.extra))], axis=-1)
        out: Array = flat - (flat @ self.Q) @ self.Q.T
        return out


class Effect(NamedTuple):
    """Size of a suspected error, its standard error, and the sum of squares it leaves behind."""

    size: float
    error: float
    left: float


def stack_of(rows: Rows, torque: Array, told: Array, loose: bool) -> Stack:
    """Stack of rows made with unit parameter vectors.

    told (R, nb) base parameters; `loose` makes changes of the mechanism a nuisance, held back by a
    prior of LOOSE.
    """
    free = rows.free
    terms = np.stack(
        [(x * told[rows.recording][:, None]).sum(-1) for x in (rows.inertia, rows.gravity)]
    )
    weight = _weight(free, np.concatenate([terms, torque[None]]))
    K, n, F = rows.friction.shape
    columns = np.zeros((K, n, n * F))
    for j in range(n):
        columns[:, j, j * F : (j + 1) * F] = rows.friction[:, j]
    if loose:
        columns = np.concatenate([columns, rows.phi * (LOOSE * np.abs(told[0]))], axis=-1)
    A = (columns * weight[:, None])[free]
    extra = told.shape[1] if loose else 0
    A = np.concatenate([A, np.eye(A.shape[1])[A.shape[1] - extra :]])
    size = np.sqrt((A**2).sum(0))
    U, s, _ = np.linalg.svd(A / np.where(size > 0, size, 1.0), full_matrices=False)
    Q = U[:, s > 1e-9 * s[0]]
    block = np.broadcast_to(block_numbers(rows)[:, None], free.shape)[free]
    block = np.append(block, block.max() + 1 + np.arange(extra)) if extra else block
    return Stack(free, weight, Q, block, extra)


def effect(stack: Stack, target: Array, column: Array) -> Effect:
    """Least-squares size of a suspect: `target` minus size times `column`, both (K, n) [N m]."""
    t, c = stack.clean(target), stack.clean(column)
    power = float(c @ c)
    if power <= 1e-9 * max(float(((column * stack.weight)[stack.free] ** 2).sum()), 1e-300):
        return Effect(0.0, np.inf, float(t @ t))
    size = float(c @ t) / power
    left = t - size * c
    scores = np.bincount(stack.block, weights=c * left)
    used = len(np.unique(stack.block))
    error = np.sqrt(used / max(used - 1, 1) * (scores**2).sum()) / power
    return Effect(size, float(error), float(left @ left))


def _weight(free: Array, terms: Array) -> Array:
    """Inverse of the error expected of each joint: a share of its terms."""
    count = np.maximum(free.sum(0), 1)
    level = (np.where(free, terms, 0.0) ** 2).sum((0, 1)) / count
    out: Array = 1.0 / np.sqrt(np.where(level > 0, level, 1.0)) / MODEL
    return out
