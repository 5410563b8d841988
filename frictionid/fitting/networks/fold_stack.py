"""Networks of all folds side by side, as one model, and the rows that they are trained on."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import needs
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction.laws.network_law import NetworkLaw

with needs("networks"):
    import torch


Tensor = Any  # of torch


class FoldStack(NamedTuple):
    """A law on a problem, with initial parameters theta (F, n, P) of F folds, on a device.

    The scales in theta stay as they are: features of the network that depend on them are computed
    once.
    """

    law: NetworkLaw
    problem: Problem
    theta: Array
    device: str

    def tensor(self, values: Array) -> Tensor:
        """Values on the device; a copy."""
        return torch.tensor(values, device=self.device)

    def by_fold(self, values: Array, axes: int) -> Tensor:
        """Values of the S nodes of fold after fold, (F S, n) with one axis, (F S, n, a) with two.

        They are the same in all folds where they lack the axis of the folds.
        """
        shape = (len(self.theta), *values.shape[-1 - axes :])
        return self.tensor(np.concatenate(np.broadcast_to(values, shape)))

    def first_nodes(self) -> Tensor:
        """First place (F,) of each fold in values that `by_fold` gives."""
        return self.tensor(np.arange(len(self.theta)) * len(self.problem.nodes.time))


class WeightedRows:
    """Residuals of the rows of a stack under weights (F, K).

    The rows of a fold weigh one on average, in squares relative to those without friction. One more
    row, the last, has no weight, for folds that have fewer rows than others.
    """

    def __init__(self, stack: FoldStack, weights: Array):
        problem = stack.problem
        squares = weights @ (problem.r**2).sum(1)
        size = (weights > 0).sum(axis=1) / np.maximum(squares, 1e-300)
        self.weights = stack.tensor(np.pad(weights * size[:, None], ((0, 0), (0, 1))))
        self.r = stack.tensor(np.pad(problem.r, ((0, 1), (0, 0))))
        self.G = stack.tensor(np.pad(problem.G, ((0, 1), (0, 0), (0, 0))))

    def squares(self, rows: Tensor, torque: Tensor) -> Tensor:
        """Weighted squares of rows (F, ...) under mean torques (F, ..., n) [N m]."""
        e = self.r[rows] - (self.G[rows] * torque[..., None, :]).sum(-1)
        weights = self.weights.gather(1, rows.flatten(1)).unflatten(1, rows.shape[1:])
        return weights * (e * e).sum(-1)
