"""G-weighted least squares: any law with parameters, all folds at once.

minimise  sum_k weights[f, k] |r_k - G_k Tf_k(theta)|^2   over theta within the law's bounds

by Levenberg-Marquardt with the law's analytic gradient [Marquardt1963]. The normal equations of all
folds are assembled from one gradient evaluation per iteration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, times
from frictionid.errors import InputError
from frictionid.friction import Friction, Law, along
from frictionid.problem import Problem

_DIFFERENCE = 1e-6


@dataclass(frozen=True)
class LeastSquares:
    """Fits the parameters of a law; starts from each of the law's `initial` values, best one wins.

    Laws without a `gradient(theta, x)` of shape (..., n, P), and laws with memory, are
    differentiated numerically.

    Examples
    --------
    >>> from frictionid.laws import CoulombViscous
    >>> LeastSquares(CoulombViscous())
    LeastSquares(law=CoulombViscous(width=0.02, shape='tanh'), iterations=60, tolerance=1e-09)
    """

    law: Law
    iterations: int = 60
    tolerance: float = 1e-9

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        weights = np.asarray(weights, dtype=float)
        _check(problem, weights)
        metric = np.einsum("kij,kil->kjl", problem.G, problem.G)
        fold = _Normal(self.law, problem, weights, metric)
        theta = self._start(fold)
        cost, damping = fold.cost(theta), np.full(len(weights), 1e-3)
        gradient, curvature = fold.equations(theta)
        for _ in range(self.iterations):
            move = _move(theta, gradient, curvature, damping, fold.low, fold.high)
            trial = np.clip(theta + move, fold.low, fold.high)
            new = fold.cost(trial)
            better = new < cost
            damping = np.clip(np.where(better, damping / 5, damping * 5), 1e-12, 1e12)
            settled = np.abs(cost - new) <= self.tolerance * cost
            theta = np.where(better[:, None], trial, theta)
            cost = np.minimum(cost, new)
            if settled.all():
                break
            if better.any():
                gradient, curvature = fold.equations(theta)
        shape = (len(weights), problem.r.shape[-1], len(self.law.names))
        return Friction(self.law, theta.reshape(shape))

    def _start(self, fold: _Normal) -> Array:
        """For each fold the best of the law's starts after one step, shape (F, N)."""
        found, costs = [], []
        for initial in self.law.initial:
            theta = np.tile(np.asarray(initial, dtype=float), fold.joints)
            gradient, curvature = fold.common_equations(theta)
            begin = np.repeat(theta[None], len(fold.weights), axis=0)
            small = np.full(len(fold.weights), 1e-9)
            move = _move(begin, gradient, curvature, small, fold.low, fold.high)
            trial = np.clip(begin + move, fold.low, fold.high)
            found.append(trial)
            costs.append(fold.cost(trial))
        best = np.argmin(costs, axis=0)
        return np.stack(found)[best, np.arange(len(best))]


class _Normal(NamedTuple):
    """Cost and normal equations of all folds; theta is flat here, (F, N) with N = n P."""

    law: Law
    problem: Problem
    weights: Array
    metric: Array  # G' G, (K, n, n)

    @property
    def joints(self) -> int:
        return int(self.problem.r.shape[-1])

    @property
    def low(self) -> Array:
        return np.tile([b[0] for b in self.law.bounds], self.joints)

    @property
    def high(self) -> Array:
        return np.tile([b[1] for b in self.law.bounds], self.joints)

    def friction(self, theta: Array) -> Friction:
        return Friction(
            self.law, theta.reshape(*theta.shape[:-1], self.joints, len(self.law.names))
        )

    def residual(self, theta: Array) -> Array:
        return self.problem.residual(along(self.friction(theta), self.problem.nodes))

    def cost(self, theta: Array) -> Array:
        return np.einsum("fk,fki->f", self.weights, self.residual(theta) ** 2)

    def equations(self, theta: Array) -> tuple[Array, Array]:
        """Downhill direction (F, N) and Gauss-Newton curvature (F, N, N) at thetas (F, N)."""
        A = self.problem_mean(theta)  # (F, K, n, P)
        F, K, n, P = A.shape
        pull = (
            times(np.swapaxes(self.problem.G, -1, -2), self.residual(theta))
            * self.weights[..., None]
        )
        downhill = np.einsum("fkj,fkjp->fjp", pull, A).reshape(F, n * P)
        curvature = np.empty((F, n, P, n, P))
        for j in range(n):
            for i in range(n):
                weighted = A[:, :, i] * (self.weights * self.metric[:, j, i])[..., None]
                curvature[:, j, :, i] = np.swapaxes(A[:, :, j], 1, 2) @ weighted
        return downhill, curvature.reshape(F, n * P, n * P)

    def common_equations(self, theta: Array) -> tuple[Array, Array]:
        """The same at one theta (N,) for all folds: the rows' products are formed only once."""
        A = self.problem_mean(theta)  # (K, n, P)
        K, n, P = A.shape
        pull = times(np.swapaxes(self.problem.G, -1, -2), self.residual(theta))
        downhill = self.weights @ (pull[..., None] * A).reshape(K, n * P)
        products = np.einsum("kjp,kji,kiq->kjpiq", A, self.metric, A).reshape(K, -1)
        return downhill, (self.weights @ products).reshape(-1, n * P, n * P)

    def problem_mean(self, theta: Array) -> Array:
        """Stencil average of dTf/dtheta, shape (..., K, n, P)."""
        at_nodes = _gradient(self.friction(theta), self.problem)
        S, n, P = at_nodes.shape[-3:]
        flat = at_nodes.reshape(*at_nodes.shape[:-3], S, n * P)
        mean = self.problem.mean(flat)
        return mean.reshape(*mean.shape[:-1], n, P)


def _gradient(friction: Friction, problem: Problem) -> Array:
    """dTf_j/dtheta_jp along the nodes, (..., S, n, P)."""
    law, nodes = friction.law, problem.nodes
    memory = law.start(friction.theta[..., None, :, :], nodes.inputs)
    if not memory and hasattr(law, "gradient"):
        out = law.gradient(friction.theta[..., None, :, :], nodes.inputs)
        shape = (*friction.theta.shape[:-2], *nodes.inputs.w.shape, friction.theta.shape[-1])
        return np.broadcast_to(out, shape)
    columns = []
    for i in range(len(law.names)):
        step = _DIFFERENCE * np.maximum(1e-2, np.abs(friction.theta[..., i]))
        shift = np.zeros_like(friction.theta)
        shift[..., i] = step
        up = along(Friction(law, friction.theta + shift), nodes)
        down = along(Friction(law, friction.theta - shift), nodes)
        columns.append((up - down) / (2 * step[..., None, :]))
    return np.stack(columns, axis=-1)


def _move(
    theta: Array, downhill: Array, curvature: Array, damping: Array, low: Array, high: Array
) -> Array:
    """Levenberg-Marquardt step (F, N); parameters that a bound stops are left out of it."""
    blocked = ((theta <= low) & (downhill < 0)) | ((theta >= high) & (downhill > 0))
    free = (~blocked).astype(float)
    H = curvature * free[:, :, None] * free[:, None, :]
    scale = np.einsum("fii->fi", H)
    # a parameter without any influence keeps its place
    floor = np.where(scale > 0, scale, 1.0)
    H = H + (damping[:, None] * floor + (scale <= 0))[:, :, None] * np.eye(H.shape[-1])
    return np.linalg.solve(H, (downhill * free)[..., None])[..., 0]


def _check(problem: Problem, weights: Array) -> None:
    K = len(problem.r)
    if weights.ndim != 2 or weights.shape[1] != K:
        raise InputError(f"weights must have shape (folds, {K}), got {weights.shape}")
    empty = np.flatnonzero(weights.sum(axis=1) <= 0)
    if len(empty):
        raise InputError(f"fold {empty[0]} has no rows to fit: use fewer folds or more recordings")
