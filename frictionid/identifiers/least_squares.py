"""G-weighted least squares: any law with parameters, all folds at once.

minimise  sum_k weights[f, k] |r_k - G_k Tf_k(theta)|^2   over theta within the law's bounds

by Levenberg-Marquardt [Marquardt1963]. Each step stays within the bounds, and its curvature learns
from earlier steps what Gauss-Newton leaves out [Dennis1981]: in the valleys of friction laws (a
higher peak that falls off sooner) that saves most of the steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction, Law
from frictionid.identifiers.box_qp import bounded
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.initial_guess import best_initial_guess
from frictionid.identifiers.linearised import Rows
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import relative, shares

_EXACT = 1e-22  # costs below this part of that without friction are rounding
_DAMPING = (1e-9, 1e9)
_CLEAR = 1e-8  # a change of slope above rounding
_ROUNDS = 4


@dataclass(frozen=True)
class LeastSquares(Identifier):
    """Fits the parameters of a law.

    It begins at those of the law's `initial` values, for each joint its own, that promise the
    lowest cost, and ends where a step promises less than the `tolerance`, relative to the cost, or
    after a number of `iterations`. Laws without a `gradient(theta, x)` of shape (..., n, P), and
    laws with memory, are differentiated numerically. A parameter without any influence keeps its
    start. Where `robust` is given, rows with residuals beyond that many standard deviations are
    weighted down and the fit is repeated.

    Raises
    ------
    InputError
        Where rows, weights or the law do not determine the parameters.

    Examples
    --------
    >>> from frictionid.identifiers.synthetic_problem import synthetic_problem
    >>> from frictionid.friction.laws import CoulombViscous
    >>> problem = synthetic_problem(joints=1)
    >>> friction = LeastSquares(CoulombViscous()).fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> print(friction[0])
    CoulombViscous(width=0.02, shape='tanh')
      joint 1  coulomb 0.1265 N m, viscous 0.01494 N m s/rad
    """

    law: Law
    iterations: int = 100
    tolerance: float = 1e-11
    robust: float | None = None
    seeded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.robust is not None and not self.robust > 0:
            raise InputError(f"robust = {self.robust} standard deviations must be positive")

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        rows = Rows(self.law, problem)
        weights = relative(weights, problem)
        theta = self._descended(_begin(rows, *best_initial_guess(rows, weights), weights), rows)
        for _ in range(_ROUNDS if self.robust else 0):
            kept = weights * shares(rows.residual(theta), weights, self.robust or 0.0)
            theta = self._descended(_begin(rows, theta, theta, kept), rows)
        return rows.friction(theta)

    def _descended(self, folds: _Folds, rows: Rows) -> Array:
        """Parameters (F, N) at the minimum that lies downhill."""
        theta, active = folds.theta.copy(), np.arange(len(folds.theta))
        for _ in range(self.iterations):
            folds, settled = _improved(rows, folds, self.tolerance)
            theta[active] = folds.theta
            active, folds = active[~settled], folds.take(~settled)
            if not len(active):
                break
        return theta


class _Folds(NamedTuple):
    """Where the folds are: theta (F, N) and what is known there.

    residual (F, K, n); cost and damping (F,); downhill (F, N), half the negative gradient of the
    cost; curvature (F, N, N) by Gauss-Newton, and bend (F, N, N), what that lacks.
    """

    theta: Array
    weights: Array
    residual: Array
    cost: Array
    downhill: Array
    curvature: Array
    bend: Array
    damping: Array

    def take(self, which: Array) -> _Folds:
        return _Folds(*(field[which] for field in self))


def _begin(rows: Rows, start: Array, stepped: Array, weights: Array) -> _Folds:
    """The folds at the better of two parameters each; far from linear, a first step may be lost."""
    with np.errstate(all="ignore"):
        better = _cost(rows.residual(stepped), weights) < _cost(rows.residual(start), weights)
    theta = np.where(better[:, None], stepped, start)
    residual = rows.residual(theta)
    equations = rows.equations(theta, residual, weights)
    cost = _cost(residual, weights)
    return _Folds(
        *(theta, weights, residual, cost, *equations),
        bend=np.zeros_like(equations[1]),
        damping=np.full(len(theta), 1e-6),
    )


def _cost(residual: Array, weights: Array) -> Array:
    return np.einsum("fk,fki->f", weights, residual**2)


def _improved(rows: Rows, folds: _Folds, tolerance: float) -> tuple[_Folds, Array]:
    """The folds after one step, and which of them have settled, (F,)."""
    move, promised = _step(folds, *rows.bounds)
    trial = np.clip(folds.theta + move, *rows.bounds)
    with np.errstate(all="ignore"):  # a step too far is refused below, whatever it meets
        residual = rows.residual(trial)
        gain = folds.cost - _cost(residual, folds.weights)
    without = _cost(rows.problem.r[None], folds.weights)
    settled = promised <= tolerance * folds.cost + _EXACT * without
    better = gain > 0
    ratio = gain / np.maximum(promised, 1e-300)
    factor = np.select([ratio > 0.75, ratio > 0.25], [0.1, 1.0], 20.0)
    new = folds._replace(
        damping=np.clip(folds.damping * factor, *_DAMPING),
        bend=np.where(better[:, None, None], folds.bend, 0.0),
        theta=np.where(better[:, None], trial, folds.theta),
        cost=np.where(better, folds.cost - gain, folds.cost),
        residual=np.where(better[:, None, None], residual, folds.residual),
    )
    return _learnt(rows, folds, new, np.flatnonzero(better & ~settled)), settled


def _step(folds: _Folds, low: Array, high: Array) -> tuple[Array, Array]:
    """Damped steps (F, N) within the bounds, and what they promise to take off the cost, (F,)."""
    eye = np.eye(folds.theta.shape[-1])
    scale = _scale(folds.curvature)
    full = folds.curvature + folds.bend
    root = np.sqrt(scale)[:, :, None] * np.sqrt(scale)[:, None, :]
    convex = np.linalg.eigvalsh(full / root).min(axis=-1, initial=1.0) >= -_DAMPING[0]
    model = np.where(convex[:, None, None], full, folds.curvature)
    damped = model + (folds.damping[:, None] * scale)[:, :, None] * eye
    move = bounded(damped, folds.downhill, low - folds.theta, high - folds.theta)
    promised = move * (2 * folds.downhill - np.einsum("fij,fj->fi", model, move))
    return move, promised.sum(axis=-1)


def _scale(curvature: Array) -> Array:
    diagonal = np.einsum("fii->fi", curvature)
    return np.where(diagonal > 0, diagonal, 1.0)


def _learnt(rows: Rows, before: _Folds, after: _Folds, moved: Array) -> _Folds:
    """`after` with the equations of the folds that moved, their bend by the rank-one formula."""
    part = after.take(moved)
    downhill, curvature = rows.equations(part.theta, part.residual, part.weights)
    move = part.theta - before.theta[moved]
    model = np.einsum("fij,fj->fi", curvature + part.bend, move)
    missing = before.downhill[moved] - downhill - model
    work = (missing * move).sum(axis=-1)
    root = np.sqrt(_scale(curvature))
    size = np.linalg.norm(missing / root, axis=-1) * np.linalg.norm(move * root, axis=-1)
    sure = np.abs(work) > _CLEAR * size
    share = np.where(sure, 1.0 / np.where(sure, work, 1.0), 0.0)
    bend = part.bend + share[:, None, None] * missing[:, :, None] * missing[:, None, :]
    return after._replace(
        downhill=_set(after.downhill, moved, downhill),
        curvature=_set(after.curvature, moved, curvature),
        bend=_set(after.bend, moved, bend),
    )


def _set(field: Array, index: Array, value: Array) -> Array:
    out = field.copy()
    out[index] = value
    return out
