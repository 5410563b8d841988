"""Least squares of laws that are linear in their parameters: one solution for each fold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction, Inputs, Law
from frictionid.identifiers.box_qp import bounded
from frictionid.identifiers.grams import check_linear, columns, grams
from frictionid.identifiers.identifier import Identifier
from frictionid.identifiers.initial_guess import check_rows
from frictionid.identifiers.least_squares import LeastSquares
from frictionid.identifiers.linearised import Rows
from frictionid.identifiers.residual import Problem
from frictionid.identifiers.row_weights import relative

_RIDGE = 1e-13
_LOOKS = 200  # nodes of each joint
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Linear(Identifier):
    """Fits a linear law within its bounds, as `LeastSquares` does, from one Gram matrix per fold.

    A fold whose solution leaves the range in which the law is linear (a level below zero counts as
    zero) is fitted by `LeastSquares`.

    Raises
    ------
    InputError
        Where rows or weights do not determine the parameters, and for laws that are not linear.

    Examples
    --------
    >>> from frictionid.identifiers.synthetic_problem import synthetic_problem
    >>> from frictionid.friction.laws import Spline
    >>> problem = synthetic_problem(joints=1)
    >>> friction = Linear(Spline((1.0, 4.0))).fit(problem, np.ones((1, len(problem.r))), seed=0)
    >>> friction.curve(np.array([0.5, 2.0, 8.0])).round(2)[0].T
    array([[0.14, 0.15, 0.26]])
    """

    law: Law
    seeded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_linear(self.law)

    def fit(self, problem: Problem, weights: Array, seed: int) -> Friction:
        rows, weights = Rows(self.law, problem), relative(weights, problem)
        A = columns(self.law, problem)
        own = np.abs(A[..., :-1]).reshape(*problem.r.shape, problem.r.shape[-1], -1)
        check_rows(rows, weights, own.max(axis=(1, 3)) > 0)
        theta = solutions(grams(A, weights)[:, 0], *rows.bounds)
        bent = ~_straight(rows.friction(theta), problem)
        if bent.any():
            found = LeastSquares(self.law).fit(problem, weights[bent], seed)
            theta[bent] = found.theta.reshape(int(bent.sum()), -1)
        return rows.friction(theta)


def solutions(T: Array, low: Array, high: Array) -> Array:
    """Parameters (F, N) within bounds (N,) around zero, of Gram matrices T (F, N + 1, N + 1)."""
    size = np.sqrt(np.einsum("fii->fi", T)[:, :-1])
    scale = np.where(size > 0, size, 1.0)
    H = T[:, :-1, :-1] / scale[:, :, None] / scale[:, None, :]
    eased = H * (1.0 + _RIDGE * np.eye(H.shape[-1]))
    return np.asarray(bounded(eased, T[:, :-1, -1] / scale, low * scale, high * scale) / scale)


def _straight(friction: Friction, problem: Problem) -> Array:
    """Whether (F,) the law is linear at theta, as far as nodes from slow to fast show it."""
    inputs, law = problem.nodes.inputs, friction.law
    S, n = inputs.w.shape
    order = np.argsort(np.abs(inputs.w), axis=0)[np.linspace(0, S - 1, min(_LOOKS, S)).astype(int)]
    x = Inputs(*(np.take_along_axis(part, order, axis=0) for part in inputs))
    theta = friction.theta[:, None]
    torque = law.torque(theta, x, ())
    linear = (law.gradient(0.0 * theta[:1], x) * theta).sum(-1)
    off = np.abs(torque - linear).max(axis=(1, 2))
    return np.asarray(off <= _ROUNDING * np.abs(linear).max(axis=(1, 2)))
