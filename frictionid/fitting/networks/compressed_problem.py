"""Compressed problems: squares of the residual as a function of friction torques at some speeds.

In a hat basis the curve is straight between node speeds. With the torques T of all joints there,

    cost = c - 2 b'T + T'A T

and a law that depends on its joint's velocity alone is fitted without the rows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array, hstack

from frictionid.arrays import Array
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction.smooth_sign import smooth_sign

_FINE = 30.0  # how much closer nodes stand at rest than at the highest speed


class Compressed(NamedTuple):
    """Squares of each fold: A (F, N, N), b (F, N) and c (F,), with N = n V.

    speeds (n, V) [rad/s]: the velocities of each joint at which its torques stand, negative ones
    first; both directions have a node at rest. rows (F,): how many rows have a weight.
    """

    A: Array
    b: Array
    c: Array
    speeds: Array
    rows: Array

    def cost(self, torque: Array) -> Array:
        """Weighted squares [rad^2/s^2] of torques (..., F, n, V), shape (..., F)."""
        T = torque.reshape(*torque.shape[:-2], -1)
        return self.c + ((self.times(T) - 2 * self.b) * T).sum(-1)

    def without(self, part: Compressed) -> Compressed:
        """Squares of the rows that are in none of a part of them."""
        A, b, c = self.A - part.A, self.b - part.b, self.c - part.c
        return Compressed(A, b, c, self.speeds, self.rows - part.rows)

    def times(self, T: Array) -> Array:
        """Product A T for T (..., F, N)."""
        return (self.A @ T[..., None])[..., 0]


def node_speeds(problem: Problem, weights: Array, count: int) -> Array:
    """Velocities (n, 2 count) from the fastest negative to the fastest positive of each joint.

    Of the rows with a weight (K,).
    """
    highest = np.abs(problem.nodes.inputs.w[problem.stencil[weights > 0]]).max(axis=(0, 1))
    share = np.expm1(np.linspace(0.0, 1.0, count) * np.log1p(_FINE)) / _FINE
    speeds = np.maximum(highest, 1e-3)[:, None] * share
    return np.concatenate([-speeds[:, ::-1], speeds], axis=1)


def compressed(
    problem: Problem, weights: Array, speeds: Array, width: float, shape: str
) -> Compressed:
    """Squares of the rows under weights (F, K), for torques at node velocities (n, V).

    width, shape : smoothing of sgn(w), which stays exact between the nodes
    """
    n, V = speeds.shape
    means = [_means(problem, j, speeds[j], width, shape) for j in range(n)]
    A, b = np.zeros((len(weights), n * V, n * V)), np.zeros((len(weights), n * V))
    for i in range(n):
        columns = hstack([diags_array(problem.G[:, i, j]) @ means[j] for j in range(n)], "csr")
        for f, weight in enumerate(weights):
            weighted = (diags_array(weight) @ columns).T
            A[f] += (weighted @ columns).toarray()
            b[f] += weighted @ problem.r[:, i]
    c = np.einsum("fk,ki->f", weights, problem.r**2)
    return Compressed(A, b, c, speeds, (weights > 0).sum(axis=1) * 1.0)


def _means(problem: Problem, joint: int, speeds: Array, width: float, shape: str) -> Any:
    """Share (K, V) of the torque at each node speed in the mean friction of each row."""
    basis = _hat_basis(problem.nodes.inputs.w[:, joint], speeds, width, shape)
    parts = zip(problem.coefficients, problem.stencil.T, strict=True)
    return sum(c * basis[index] for c, index in parts)


def _hat_basis(w: Array, speeds: Array, width: float, shape: str) -> Any:
    """Hat functions (S, V) of the node speeds at velocities w (S,), times |sgn(w)| smoothed."""
    half = len(speeds) // 2
    positive = speeds[half:]
    below = np.clip(np.searchsorted(positive, np.abs(w), side="right") - 1, 0, half - 2)
    share = (np.abs(w) - positive[below]) / (positive[below + 1] - positive[below])
    sign = np.abs(smooth_sign(w, width, shape))
    low = np.where(w > 0, half + below, half - 1 - below)
    high = np.where(w > 0, low + 1, low - 1)
    rows = np.tile(np.arange(len(w)), 2)
    values = np.concatenate([(1.0 - share) * sign, share * sign])
    return csr_array((values, (rows, np.concatenate([low, high]))), (len(w), len(speeds)))
