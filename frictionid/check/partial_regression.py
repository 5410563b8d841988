"""Partial regression: suspected errors, one or several, beside all that may be unknown anyway.

Rows of all joints are stacked and weighted. The nuisance columns (free friction and, for some
questions, moderate changes of the mechanism) are projected out once; suspected errors are then a
regression on their columns (Frisch-Waugh-Lovell).
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.fitting.one_step.balances import Rows

from .regression import block_numbers, friction_columns, row_rms, unit_columns

# Prior standard deviation of the mechanism's parameters where they are a nuisance, as a share.
PARAMETER_PRIOR = 0.3
# Share of its terms that a balance usually fails by.
MODEL = 0.02


class PartialRegression(NamedTuple):
    """Weighted rows with the nuisance projected out.

    moving (K, n) : which joints of which rows count; weight (n,) [1/(N m)]; Q (N, P) : orthonormal
    basis of the nuisance; block (N,) : correlated errors; priors : rows that hold the mechanism
    """

    moving: Array
    weight: Array
    Q: Array
    block: Array
    priors: int

    def residual(self, torque: Array) -> Array:
        """Weighted torques (..., K, n) without their nuisance part, (..., N)."""
        at = np.flatnonzero(self.moving)
        out = np.zeros((*torque.shape[:-2], len(at) + self.priors))
        every = (torque * self.weight).reshape(*torque.shape[:-2], self.moving.size)
        out[..., : len(at)] = every.take(at, axis=-1)
        out -= (out @ self.Q) @ self.Q.T
        return out

    def estimate(self, target: Array, *columns: Array) -> tuple[Array, Array, float]:
        """Least squares of `target` minus values times columns, all (K, n) [N m].

        Values (P,), their standard errors, and the sum of squares that they leave.
        """
        t, C = self.residual(target), self.residual(np.stack(columns)).T
        size = np.sqrt(
            [max(float(((c * self.weight)[self.moving] ** 2).sum()), 1e-300) for c in columns]
        )
        C /= size
        inverse = np.linalg.inv(C.T @ C + 1e-12 * np.eye(len(size)))
        shown = np.diag(inverse) < 1e9  # else the nuisance, or the other columns, account for it
        value = np.where(shown, inverse @ (C.T @ t), 0.0)
        left = t - C @ value
        scores = np.stack([np.bincount(self.block, weights=c * left) for c in C.T], axis=-1)
        used = len(np.unique(self.block))
        error = np.sqrt(used / max(used - 1, 1) * ((scores @ inverse) ** 2).sum(0))
        return value / size, np.where(shown, error / size, np.inf), float(left @ left)

    def left_in_row(self, target: Array, column: Array, value: float) -> float:
        """Share of squares that `value` times a column leaves in the balance it changes most."""
        power = (np.where(self.moving, column * self.weight, 0.0) ** 2).sum(0)
        row = np.broadcast_to(np.arange(len(power)), self.moving.shape)[self.moving]
        most = row == int(np.argmax(power))
        t, c = (self.residual(x)[: len(row)][most] for x in (target, column))
        return float(((t - value * c) ** 2).sum() / max(float((t**2).sum()), 1e-300))


class Nuisance(NamedTuple):
    """What may be unknown anyway in the balances of some rows, for any torque.

    columns (N, P) of the balances that count, with the rows that hold the mechanism last; level
    (n,) mean squares of each joint's nominal terms; for the rest see `PartialRegression`
    """

    moving: Array
    columns: Array
    level: Array
    block: Array
    priors: int

    def beside(self, torque: Array) -> PartialRegression:
        """Partial regression beside it of torques (K, n) [N m] like this one."""
        moving, N = self.moving, len(self.columns) - self.priors
        level = self.level + row_rms(torque, moving) ** 2
        # the inverse of the error expected of each joint: a share of its terms
        weight = 1.0 / np.sqrt(np.where(level > 0, level, 1.0)) / MODEL
        A = self.columns.copy()
        A[:N] *= np.broadcast_to(weight, moving.shape)[moving][:, None]
        U, s, _ = np.linalg.svd(unit_columns(A)[0], full_matrices=False)
        return PartialRegression(moving, weight, U[:, s > 1e-9 * s[0]], self.block, self.priors)


def nuisance_of(rows: Rows, nominal: Array, prior: float | None = None) -> Nuisance:
    """Free friction of rows of unit parameter vectors, and perhaps changes of the mechanism.

    nominal (R, nb) base parameters; with a `prior` changes of them are a nuisance, too, held by it,
    a share of each; where that is 1 and more, those that are zero are free as well
    """
    moving, terms = rows.moving, rows.at(nominal)
    columns = friction_columns(rows)
    priors = 0 if prior is None else nominal.shape[1]
    if prior is not None:
        changes = rows.regressor * (prior * np.abs(nominal[0]))
        if prior >= 1.0:
            silent = np.where(nominal[0] == 0.0, rows.regressor, 0.0)
            top = np.abs(silent).max((0, 1), initial=0.0)
            changes += silent * np.abs(rows.required(nominal)).max() / np.where(top > 0, top, 1.0)
        columns = np.concatenate([columns, changes], axis=-1)
    P = columns.shape[-1]
    columns = np.concatenate([columns[moving], np.eye(P)[P - priors :]])
    block = block_numbers(rows)
    block = np.append(block, block.max() + 1 + np.arange(priors)) if priors else block
    level = sum(row_rms(x[..., 0], moving) ** 2 for x in (terms.inertia, terms.gravity))
    return Nuisance(moving, columns, np.asarray(level), block, priors)


def partial_regression(rows: Rows, torque: Array, nominal: Array) -> PartialRegression:
    """Partial regression on rows of unit parameter vectors, with free friction as nuisance."""
    return nuisance_of(rows, nominal).beside(torque)


def refined_delay(
    nuisance: Nuisance,
    required: Array,
    means: Callable[[Sequence[float]], Iterable[Array]],
    best: float,
    steps: tuple[float, float, int],
) -> tuple[float, float, float]:
    """Delay [s] of torques by Gauss-Newton from a near one, its error, and the squares it leaves.

    required (K, n) : what the nominal mechanism needs ; means : of the torques, (K, n) for each of
    some delays ; steps : of the derivative [s], the largest one [s], and how many
    """
    small, large, count = steps
    for _ in range(count):
        early, middle, late = means([best - small, best, best + small])
        fit = nuisance.beside(middle)
        step, error, left = fit.estimate(middle - required, (early - late) / (2 * small))
        best += float(np.clip(step[0], -large, large))
    return best, float(error[0]), left
