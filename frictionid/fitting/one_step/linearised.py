"""Residuals of a law on the rows of a problem, and their Jacobian in its parameters.

Of laws that are linear in their parameters, Gram matrices are all that a fit needs of the rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, stretches
from frictionid.errors import InputError
from frictionid.friction import Constraints, Friction, Groups, Law, Nodes, along, constraints_of

from ..gauss_newton import Conditions
from .residual import Problem, data_range

_DIFFERENCE = 1e-6
_EXACT = 1e-22  # costs below this part of that without friction are rounding
_TORQUES = 1e7  # computed at a time
_ROWS, _MANY = 20_000, 4  # at a time, of so many parameters at most


Ranges = Mapping[str, tuple[float, float]]  # by parameter name
# Bounds, means and standard deviations of priors, and equal joints.
Given = tuple[Ranges, Ranges, Groups]


class Linearised(NamedTuple):
    """A law on a problem; its parameters theta are flat here, (F, N) with N = n P.

    Equal joints have the same parameters, which are there once: theta of all is tie @ theta then.

    constraints : bounds and priors (F, n, P), see `within`; tie : (n P, N), None where all joints
        have parameters of their own
    """

    law: Law
    problem: Problem
    constraints: Constraints | None = None
    tie: Array | None = None

    @staticmethod
    def within(law: Law, problem: Problem, weights: Array, settings: Given) -> Linearised:
        """A law on a problem, bounded by what the rows of each fold resolve, weights (F, K)."""
        constraints = constraints_of(law, data_range(problem, weights), *settings)
        return Linearised(problem.fitted_form(law), problem, constraints, constraints.tie)

    def decided(self, absent: Array) -> Linearised:
        """The same with optional terms decided: absent ones (F, n, P) are zero, others free."""
        size = np.where([p.optional for p in self.law.parameters], np.inf, self._limits.size)
        free = self._replace(constraints=replace(self._limits, size=size))
        return free._holding(absent, 0.0)

    def without(self, joints: Array) -> Linearised:
        """The same with joints (F, n) without friction, or with as little as the bounds allow."""
        limits = self._limits
        least = np.clip(0.0, limits.low, limits.high)
        neutral = self.law.neutral(least, limits.neutral)
        least = np.where(np.isfinite(limits.size), neutral, least)
        return self._holding(joints[..., None], least)

    def _holding(self, which: Array, values: Array | float) -> Linearised:
        """The same with some parameters (F, n, P) at these values, without a prior."""
        limits = self._limits
        low, high = (np.where(which, values, x) for x in (limits.low, limits.high))
        deviation, size = (np.where(which, np.inf, x) for x in (limits.deviation, limits.size))
        held = replace(limits, low=low, high=high, deviation=deviation, size=size)
        return self._replace(constraints=held)

    def tied(self, theta: Array) -> Array:
        """Parameters (F, N) of equal joints: the means of those (F, n P) that each has by itself.

        Within the bounds.
        """
        if self.tie is None:
            return theta
        return np.clip(theta @ self.tie / self.tie.sum(axis=0), *self.bounds)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.problem.r.shape[-1])

    @property
    def _limits(self) -> Constraints:
        assert self.constraints is not None
        return self.constraints

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the parameters, (F, N) each."""
        return self.once(self._limits.low), self.once(self._limits.high)

    def conditions(self, weights: Array, variance: Array) -> Conditions:
        """Those of F fits under weights (F, K).

        variance : (F, 1) of the weighted residuals, which makes priors comparable with them, or
            (F, N), times the excess of each parameter, see `Spread`
        """
        mean = self.once(self._limits.mean)
        precision = self.once(self._limits.deviation) ** -2.0 * variance
        floor = _EXACT * self.cost(self.problem.r[None], weights)
        return Conditions(weights, *self.bounds, mean, precision, floor)

    @property
    def size(self) -> Array:
        """Sizes (F, N) of the parameters, infinite where there is no neutral value."""
        return self.once(self._limits.size)

    def neutral(self, theta: Array) -> Array:
        """Neutral values (F, N) beside parameters theta (F, N)."""
        each = np.asarray(self.friction(theta).theta)
        return self.once(self.law.neutral(each, self._limits.neutral))

    def once(self, each: Array) -> Array:
        """Numbers (F, n, P) that equal joints have alike, flat, (F, N)."""
        flat = each.reshape(len(each), -1)
        return flat if self.tie is None else flat[:, self.tie.argmax(axis=0)]

    def friction(self, theta: Array) -> Friction:
        """Friction with the parameters theta."""
        theta = theta if self.tie is None else theta @ self.tie.T
        theta = theta.reshape(len(theta), self.joints, len(self.law.names))
        limits = self.constraints
        fits = limits is not None and limits.low.shape == theta.shape
        return Friction(self.law, theta, constraints=limits if fits else None)

    def stretches(self, thetas: int = 1) -> Iterator[tuple[slice, Linearised]]:
        """Rows, some at a time, and the law on them: long recordings need no more memory.

        Rows of whole recordings for a law with memory, which acts along them.

        thetas : number of parameters that are looked at together: the more, the fewer rows
        """
        K, most = len(self.problem.r), max(_ROWS // max(thetas // _MANY, 1), 1)
        if K <= most:
            yield slice(0, K), self
            return
        if self.law.has_memory:
            yield from self._whole_recordings(most)
            return
        for first in range(0, K, most):
            rows = slice(first, min(first + most, K))
            stencil = self.problem.stencil[rows]
            low, high = int(stencil.min()), int(stencil.max()) + 1
            part = self.problem.with_rows(rows, slice(low, high), stencil - low)
            yield rows, self._replace(problem=part)

    def _whole_recordings(self, most: int) -> Iterator[tuple[slice, Linearised]]:
        """Rows of recordings that follow each other, as many as have so many rows, or one."""
        problem, first = self.problem, 0
        ends = [*(1 + np.flatnonzero(np.diff(problem.recording))).tolist(), len(problem.r)]
        for end, next_end in zip(ends, [*ends[1:], np.inf], strict=True):
            if next_end - first > most:
                part = problem.of_rows(np.arange(first, end))
                yield slice(first, end), self._replace(problem=part)
                first = end

    def every(self, step: int) -> Linearised:
        """The same on every `step`-th row only, with the nodes that these need; without memory."""
        problem = self.problem
        places, stencil = np.unique(problem.stencil[::step], return_inverse=True)
        few = problem.with_rows(slice(None, None, step), places, stencil)
        return self._replace(problem=few)

    def residual(self, theta: Array) -> Array:
        """Residuals e, shape (F, K, n) [rad/s]."""
        friction = self.friction(theta)
        out = np.empty((len(theta), *self.problem.r.shape))
        for rows, part in self.stretches():
            out[:, rows] = part.problem.residual(along(friction, part.problem.nodes))
        return out

    def jacobian(self, theta: Array) -> Array:
        """Jacobian -de/dtheta = G dTf/dtheta, shape (F, K, n, n, P): Tf_j depends on theta_j only.

        The axes after the rows are those of the residual's joint, and of friction's joint j.
        """
        return self.problem.G[..., None] * self.slopes(theta)[:, :, None]

    def slopes(self, theta: Array) -> Array:
        """Derivatives of the mean torques in the rows, dTf_j/dtheta_j, shape (F, K, n, P)."""
        at_nodes = torque_gradient(self.friction(theta), self.problem)
        F, S, n, P = at_nodes.shape
        mean = self.problem.mean(at_nodes.reshape(F, S, n * P))
        return mean.reshape(F, len(self.problem.r), n, P)

    def normal_equations(
        self, theta: Array, residual: Array, weights: Array
    ) -> tuple[Array, Array]:
        """Descent direction J'We (F, N) and Gauss-Newton Hessian J'WJ (F, N, N) of each fold.

        Fold by fold, which stays in the processor's cache; with memory, time is the outer loop.

        Raises
        ------
        InputError
            Where they are not finite.
        """
        F, N = theta.shape
        folds_at_once = max(F, 1) if self.law.has_memory else 1
        descent, hessian = np.zeros((F, N)), np.zeros((F, N, N))
        for first in range(0, F, folds_at_once):
            part = slice(first, first + folds_at_once)
            for rows, stretch in self.stretches():
                slopes, e = stretch.slopes(theta[part]), residual[part, rows]
                # fold by fold: a batch of them would be rounded otherwise than each one alone
                for f, weight in enumerate(weights[part, rows], first):
                    k = f - first
                    onto, square = _weighted_squares(stretch.problem.G, slopes[k], e[k], weight)
                    descent[f] += onto if self.tie is None else self.tie.T @ onto
                    hessian[f] += square if self.tie is None else self.tie.T @ square @ self.tie
        self.check_finite(descent, hessian)
        return descent, hessian

    def cost(self, residual: Array, weights: Array) -> Array:
        """Weighted squares (F,) of residuals (F, K, n)."""
        squares = np.einsum("...n,...n->...", residual, residual)
        return (weights * squares).sum(axis=-1)

    def possible(self, theta: Array) -> Array:
        """The parameters: all within the bounds are possible."""
        return theta

    def check_finite(self, *arrays: Array) -> None:
        """Refuse arrays with numbers that are not finite.

        Raises
        ------
        InputError
            Saying where to look.
        """
        if not all(np.isfinite(array).all() for array in arrays):
            raise InputError(
                f"the fit of {self.law} met numbers that are not finite: look for such rows in the "
                "problem, and for parameters within the law's bounds where its torque is not finite"
            )


def _weighted_squares(G: Array, slopes: Array, e: Array, weight: Array) -> tuple[Array, Array]:
    """J'We (N,) and J'WJ (N, N) of rows whose Jacobian is J_k = G_kj s_kj, slopes s (K, n, P).

    (J'We)_j = sum_k w_k (G_k'e_k)_j s_kj,   (J'WJ)_ji = sum_k w_k (G_k'G_k)_ji s_kj s_ki'
    """
    K, n, P = slopes.shape
    by_joint = np.ascontiguousarray(np.swapaxes(slopes, 0, 1))  # (n, K, P)
    by_column = np.ascontiguousarray(G.transpose(2, 1, 0))  # (n, n, K): rows are many
    onto, squares = np.einsum("kij,ki,k->jk", G, e, weight), np.zeros((n, P, n, P))
    for j in range(n):
        for i in range(j + 1):
            pair = np.einsum("ik,ik,k->k", by_column[j], by_column[i], weight)
            squares[j, :, i] = (by_joint[j] * pair[:, None]).T @ by_joint[i]
            squares[i, :, j] = squares[j, :, i].T
    descent = np.stack([onto[j] @ by_joint[j] for j in range(n)])
    return descent.ravel(), squares.reshape(n * P, n * P)


def torque_gradient(friction: Friction, problem: Problem) -> Array:
    """dTf_j/dtheta_jp along the nodes, (F, S, n, P)."""
    law, nodes, theta = friction.law, problem.nodes, friction.theta
    shape = (len(theta), *nodes.inputs.w.shape, theta.shape[-1])
    by_node = theta[..., None, :, :]
    if law.has_gradient and not law.has_memory:
        return np.broadcast_to(law.gradient(by_node, nodes.inputs), shape)
    out, at_once = np.empty(shape), max(1, int(_TORQUES / (2 * np.prod(shape[:-1]))))
    for first in range(0, len(law.names), at_once):
        which = range(first, min(first + at_once, len(law.names)))
        differences = _central_differences(friction, nodes, which)
        out[..., first : first + at_once] = np.moveaxis(differences, 0, -1)
    return out


def _central_differences(friction: Friction, nodes: Nodes, which: Sequence[int]) -> Array:
    """Derivatives of the torque along the nodes in some parameters (p,), shape (p, F, S, n)."""
    law, theta = friction.law, friction.theta
    both = np.repeat(np.repeat(theta[None], 2, axis=0)[:, None], len(which), axis=1)
    for k, i in enumerate(which):
        step = _DIFFERENCE * np.maximum(1e-2, np.abs(theta[..., i]))
        low, high = law.bounds[i]
        both[0, k, ..., i] = np.minimum(theta[..., i] + step, high)
        both[1, k, ..., i] = np.maximum(theta[..., i] - step, low)
    above, below = along(Friction(law, both), nodes)  # one pass over time, for all of them
    apart = np.stack([(both[0] - both[1])[k, ..., i] for k, i in enumerate(which)])
    return (above - below) / apart[..., None, :]


# --- Laws that are linear in their parameters ----------------------------------------------------
#
# With a column a = G sum_m c_m f(node_m) for each parameter, and the residual r as the last one,
#
#     A = [a, r],   T = sum_k w_k A_k' A_k
#
# Rows that weigh the same in every fold are added up once; each fold then adds a few matrices.

FEW = 10  # recordings whose scatter says little
_STRETCHES = 20
_CELLS = 2000


def columns(law: Law, problem: Problem) -> Array:
    """Columns [a, r] of all rows, shape (K, n, N + 1), for a law that is linear in theta."""
    linearised = Linearised(law, problem)
    K, n = problem.r.shape
    A = linearised.jacobian(np.zeros((1, n * len(law.names))))[0].reshape(K, n, -1)
    linearised.check_finite(A, problem.r)
    return np.concatenate([A, problem.r[..., None]], axis=-1)


def clusters(problem: Problem) -> Array:
    """Cluster (K,) of each row: its recording, or where these are few, a stretch of it.

    >>> from frictionid.fitting.identifiers.check_identifier import synthetic_problem
    >>> labels = clusters(synthetic_problem(1))  # three recordings
    >>> len(np.unique(labels))
    21
    """
    count = len(np.unique(problem.recording))
    pieces = 1 if count >= FEW else -(-_STRETCHES // count)
    return stretches(problem.recording, problem.time, pieces)


def grams(A: Array, weights: Array, labels: Array) -> Array:
    """Gram matrices (F, C, M, M) of each fold in each cluster of labels (K,).

    A (K, n, M), weights (F, K)
    """
    M, count = A.shape[-1], int(labels.max()) + 1
    keys = np.ascontiguousarray(np.concatenate([labels[None], weights]).T)  # (K, F + 1)
    keys = keys.view([("", keys.dtype)] * keys.shape[1])[:, 0]  # one key for each row
    _, first, cell = np.unique(keys, return_index=True, return_inverse=True)
    if len(first) > _CELLS:
        parts = [_by(labels, count, A * np.sqrt(w)[:, None, None]) for w in weights]
        return np.stack(parts)
    of_cells = _by(cell, len(first), A)
    out = np.zeros((len(weights), count, M * M))
    for c in range(count):
        cells = labels[first] == c
        out[:, c] = weights[:, first[cells]] @ of_cells[cells].reshape(int(cells.sum()), M * M)
    return out.reshape(len(weights), count, M, M)


def _by(label: Array, count: int, A: Array) -> Array:
    """Gram matrix (count, M, M) of the rows with each label."""
    order = np.argsort(label, kind="stable")
    edges = np.searchsorted(label[order], np.arange(count + 1))
    table = A[order].reshape(len(A), -1)
    flat = [table[a:b].reshape(-1, A.shape[-1]) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return np.stack([part.T @ part for part in flat])
