"""What networks are trained on, as tensors: stacked folds, rows, and pieces of recordings.

Cells of recurrent networks read some samples before the rows that count, to fill their memory.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError, needs
from frictionid.friction import Friction, Nodes, memory_at_nodes
from frictionid.friction.laws.layers import count
from frictionid.friction.laws.network_law import NetworkLaw

from ..one_step.residual import Problem
from .cells import CompiledCells, cells

with needs("networks"):
    import torch


Tensor = Any  # of torch


class FoldStack(NamedTuple):
    """A law on the problems of F folds, with initial parameters theta (F, n, P), on a device.

    Problems have the same rows, of other residuals where calibrations differ. The scales in theta
    stay as they are: features of the network that depend on them are computed once.
    """

    law: NetworkLaw
    problems: Sequence[Problem]
    theta: Array
    device: str

    @property
    def problem(self) -> Problem:
        """One of them, for what all share: rows, nodes and their times."""
        return self.problems[0]

    def tensor(self, values: Array) -> Tensor:
        """Values on the device; a copy."""
        return torch.tensor(values, device=self.device)

    def features(self) -> list[Tensor]:
        """`Features` of the S nodes of fold after fold, (F S, n, ...), and what cells read."""
        pairs = zip(self.theta, self.problems, strict=True)
        each = [
            (
                *self.law.features(theta, p.nodes.inputs, window(self.law, theta, p.nodes)),
                self.law.read(theta, p.nodes.inputs),
            )
            for theta, p in pairs
        ]
        return [None if x[0] is None else self._joined(x) for x in zip(*each, strict=True)]

    def _joined(self, values: Sequence[Array]) -> Tensor:
        """Values (S, n, ...) of each fold, one after the other; some are the same at all nodes."""
        S, n = self.problem.nodes.inputs.w.shape
        return self.tensor(
            np.concatenate([np.broadcast_to(x, (S, n, *x.shape[2:])) for x in values])
        )

    def first_nodes(self) -> Tensor:
        """First place (F,) of each fold in values that `features` gives."""
        return self.tensor(np.arange(len(self.theta)) * len(self.problem.nodes.time))


class WeightedRows:
    """Residuals of the rows of a stack under weights (F, K).

    The rows of a fold weigh one on average, in squares relative to those without friction. One more
    row, the last, has no weight, for folds that have fewer rows than others.
    """

    def __init__(self, stack: FoldStack, weights: Array):
        distinct = {id(p): p for p in stack.problems}
        places = {key: place for place, key in enumerate(distinct)}
        owner = np.array([places[id(p)] for p in stack.problems])
        r, G = (np.stack([getattr(p, x) for p in distinct.values()]) for x in ("r", "G"))
        squares = (weights * (r**2).sum(axis=2)[owner]).sum(axis=1)
        size = (weights > 0).sum(axis=1) / np.maximum(squares, 1e-300)
        self.weights = stack.tensor(np.pad(weights * size[:, None], ((0, 0), (0, 1))))
        r, G = (np.pad(x, ((0, 0), (0, 1), *((0, 0),) * (x.ndim - 2))) for x in (r, G))
        self.r, self.G = (stack.tensor(np.concatenate(x)) for x in (r, G))
        self.first = stack.tensor(owner * r.shape[1])

    def squares(self, rows: Tensor, torque: Tensor) -> Tensor:
        """Weighted squares of rows (F, ...) under mean torques (F, ..., n) [N m]."""
        at = rows + self.first.reshape(-1, *(1,) * (rows.ndim - 1))
        e = self.r[at] - (self.G[at] * torque[..., None, :]).sum(-1)
        weights = self.weights.gather(1, rows.flatten(1)).unflatten(1, rows.shape[1:])
        return weights * (e * e).sum(-1)


def _taken(values: Tensor, nodes: Tensor) -> Tensor:
    """Values at nodes (F, ...), from those of all folds in one series."""
    return values.index_select(0, nodes.flatten()).unflatten(0, nodes.shape)


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
        self.z, self.share, self.sign, self.read = stack.features()

    def cost(self, theta: Tensor, items: Tensor) -> Tensor:
        """Mean weighted squares (F,) of the rows of the pieces (F, B)."""
        read = _taken(self.read, self.samples[items] + self.first)  # (F, B, T, n, a)
        points = self.points[items] + self.first
        z, share, sign = (_taken(s, points) for s in (self.z, self.share, self.sign))
        torque = self._level(theta, read, z, share) * sign
        width = self.per_sample * (self.rows_per_item - 1) + 1
        mean = sum(
            c * torque[:, :, m : m + width : self.per_sample]
            for m, c in enumerate(self.coefficients)
        )
        squares = self.rows.squares(self.targets[items], mean)
        return squares.sum((1, 2)) / (items.shape[1] * self.rows_per_item)

    def _level(self, theta: Tensor, read: Tensor, z: Tensor, share: Tensor) -> Tensor:
        """Level (F, B, points, n); cells of odd laws read the motion and its mirror image."""
        signs = (1.0, -1.0) if self.law.odd else (1.0,)
        h = self._cells(theta, torch.cat([sign * read for sign in signs], dim=1))
        h = h.repeat_interleave(self.per_sample, dim=2)[:, :, : share.shape[2]]
        levels = []
        for outputs in h.chunk(len(signs), dim=1):
            features = torch.cat([z, outputs], dim=-1).flatten(1, 2)
            level: Any = self.law.level(theta[:, None], features, share.flatten(1, 2))
            levels.append(level.unflatten(1, share.shape[1:3]))
        return sum(levels) / len(levels)

    def _cells(self, theta: Tensor, read: Tensor) -> Tensor:
        """Outputs (F, B, T - burn_in, n, cells) of the cells that read (F, B, T, n, a)."""
        a, b = self.law.gate_sizes
        weights = theta[..., 3 : 3 + count(self.law.gate_sizes)].unflatten(2, (a + 1, b))
        if theta.device.type == "cpu":
            return CompiledCells.apply(weights, read, self.burn_in)
        return cells(weights, read, self.burn_in)


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


class RowTrainingSet:
    """Rows of a problem under weights (F, K); each is an item of a batch.

    used : (F, items), which of them have a weight in a fold
    """

    rows_per_item = 1

    def __init__(self, stack: FoldStack, weights: Array):
        problem = stack.problem
        self.law, self.items = stack.law, len(problem.r)
        self.rows, self.used = WeightedRows(stack, weights), np.asarray(weights > 0)
        self.stencil = stack.tensor(np.pad(problem.stencil, ((0, 1), (0, 0))))
        self.coefficients = stack.tensor(problem.coefficients)[:, None]
        self.first = stack.first_nodes()[:, None]
        self.features = stack.features()[:3]

    def cost(self, theta: Tensor, items: Tensor) -> Tensor:
        """Mean weighted squares (F,) of the items (F, B)."""
        torque = self._torque(theta, self.stencil[items].flatten(1))
        mean = (torque.unflatten(1, (-1, len(self.coefficients))) * self.coefficients).sum(2)
        return self.rows.squares(items, mean).mean(1)

    def _torque(self, theta: Tensor, nodes: Tensor) -> Tensor:
        """Torque (F, N, n) at nodes (F, N)."""
        z, share, sign = (_taken(s, nodes + self.first) for s in self.features)
        level = self.law.level(theta[:, None], z, share)
        return level * sign


def window(law: NetworkLaw, theta: Array, nodes: Nodes) -> tuple[Array, ...]:
    """Memory (S, n) at each node of a law that remembers samples of the velocity, newest first.

    None of laws with cells, which read the samples one after the other.

    Raises
    ------
    InputError
        Where a law has a memory of another kind.
    """
    if not law.has_memory or (law.is_network and law.cells):
        return ()
    if not law.reads_window:
        raise InputError(f"{law}: networks with a memory of this kind cannot be trained")
    return memory_at_nodes(Friction(law, theta), nodes)
