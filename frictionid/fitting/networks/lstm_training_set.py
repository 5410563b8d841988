"""Training set of recurrent networks: pieces of recordings, as tensors.

Cells read some samples before the rows that count, which fills their memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from frictionid.arrays import Array
from frictionid.fitting.networks.fold_stack import FoldStack, Tensor, WeightedRows
from frictionid.fitting.networks.lstm_cells import Cells
from frictionid.fitting.one_step.residual import Problem
from frictionid.friction.laws.layers import count


class SequenceTrainingSet:
    """Pieces of recordings under weights (F, K): `burn_in` samples, then `targets` rows that count.

    Each piece is an item of a batch.

    used : (F, items), which of them have rows with a weight in a fold
    """

    def __init__(self, stack: FoldStack, weights: Array, burn_in: int, targets: int):
        problem = stack.problem
        self.law, self.burn_in, self.rows_per_item = stack.law, burn_in, targets
        self.per_sample = problem.nodes.per_sample
        samples, points, rows = _pieces(problem, burn_in, targets)
        self.items = len(samples)
        self.used = np.any(np.pad(weights, ((0, 0), (0, 1)))[:, rows] > 0, axis=2)
        pad = ((0, 1), (0, 0))  # one more piece, without weight
        self.samples, self.points = (stack.tensor(np.pad(x, pad)) for x in (samples, points))
        self.targets = stack.tensor(np.pad(rows, pad, constant_values=len(problem.r)))
        self.rows = WeightedRows(stack, weights)
        self.coefficients = [float(c) for c in problem.coefficients]
        self.first = stack.first_nodes()[:, None, None]
        of = stack.law.features(stack.theta[:, None], problem.nodes.inputs)
        parts: Any = ((of.read, 2), (of.z, 2), (of.share, 1), (of.sign, 1))
        self.read, self.z, self.share, self.sign = (stack.by_fold(*part) for part in parts)

    def cost(self, theta: Tensor, items: Tensor) -> Tensor:
        """Mean weighted squares (F,) of the rows of the pieces (F, B)."""
        read = self._taken(self.read, self.samples[items])  # (F, B, T, n, a)
        points = self.points[items]
        z, share, sign = (self._taken(s, points) for s in (self.z, self.share, self.sign))
        torque = self._level(theta, read, z, share) * sign
        width = self.per_sample * (self.rows_per_item - 1) + 1
        mean = sum(
            c * torque[:, :, m : m + width : self.per_sample]
            for m, c in enumerate(self.coefficients)
        )
        squares = self.rows.squares(self.targets[items], mean)
        return squares.sum((1, 2)) / (items.shape[1] * self.rows_per_item)

    def _taken(self, values: Tensor, nodes: Tensor) -> Tensor:
        """Values at nodes (F, ...) of each fold, from those of all folds in one series."""
        flat = (nodes + self.first).flatten()
        return values.index_select(0, flat).unflatten(0, nodes.shape)

    def _level(self, theta: Tensor, read: Tensor, z: Tensor, share: Tensor) -> Tensor:
        """Level (F, B, points, n); cells of odd laws read the motion and its mirror image."""
        signs = (1.0, -1.0) if self.law.odd else (1.0,)
        h = self._cells(theta, torch.cat([sign * read for sign in signs], dim=1))
        h = h.repeat_interleave(self.per_sample, dim=2)[:, :, : share.shape[2]]
        levels = []
        for own in h.chunk(len(signs), dim=1):
            features = torch.cat([z, own], dim=-1).flatten(1, 2)
            level: Any = self.law.level(theta[:, None], features, share.flatten(1, 2))
            levels.append(level.unflatten(1, share.shape[1:3]))
        return sum(levels) / len(levels)

    def _cells(self, theta: Tensor, read: Tensor) -> Tensor:
        """Outputs (F, B, T - burn_in, n, cells) of the cells that read (F, B, T, n, a)."""
        a, b = self.law.gate_sizes
        weights = theta[..., 3 : 3 + count(self.law.gate_sizes)].flatten(0, 1)
        by_time = read.permute(2, 0, 3, 4, 1).flatten(1, 2)  # (T, F n, a, B)
        h = Cells.apply(weights.unflatten(1, (a + 1, b)), by_time, self.burn_in)
        return h.unflatten(1, theta.shape[:2]).permute(1, 4, 0, 2, 3)


def _pieces(problem: Problem, burn_in: int, targets: int) -> tuple[Array, Array, Array]:
    """Nodes (C, T) of the samples, nodes (C, P) of the targets, and their rows (C, targets).

    Samples before a recording's first, and after its last, repeat these; targets without a row have
    the row K.
    """
    nodes, per = problem.nodes, problem.nodes.per_sample
    further = len(problem.coefficients) - 1  # nodes of a row beyond its first
    row_at = np.full(len(nodes.time), len(problem.r))
    row_at[problem.stencil[:, 0]] = np.arange(len(problem.r))
    length = burn_in + targets + further // per
    samples, points, rows = [], [], []
    for first, end in zip(nodes.first[:-1], nodes.first[1:], strict=True):
        last = (end - first - 1) // per
        for begin in range(-burn_in, last - burn_in, targets):
            at = begin + np.arange(length)
            samples.append(first + per * np.clip(at, 0, last))
            point = per * (begin + burn_in) + np.arange(per * (targets - 1) + further + 1)
            points.append(first + np.clip(point, 0, end - first - 1))
            target = begin + burn_in + np.arange(targets)
            row = row_at[first + per * np.clip(target, 0, last)]
            rows.append(np.where(target <= last, row, len(problem.r)))
    return np.stack(samples), np.stack(points), np.stack(rows)
