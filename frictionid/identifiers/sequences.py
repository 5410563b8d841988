"""What a recurrent network learns from: pieces of recordings, as tensors.

Its cells read some samples before those that count, which fills their memory. Their loop over time
goes forth and back by hand: what automatic differentiation would add to each small product is most
of the time it takes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from frictionid.arrays import Array
from frictionid.identifiers.lessons import Tensor, by_fold, told
from frictionid.laws.layers import count
from frictionid.problem import Problem


class Sequences:
    """Pieces of recordings for an `LSTM`: `burn_in` samples, then `targets` rows that count."""

    def __init__(
        self,
        law: Any,
        problem: Problem,
        theta: Array,
        weights: Array,
        device: str,
        burn_in: int,
        targets: int,
    ):
        self.law, self.device, self.rows, self.burn_in = law, device, targets, burn_in
        self.folds, self.joints = theta.shape[:2]
        nodes = problem.nodes
        self.per = nodes.per_sample
        samples, points, rows = _pieces(problem, burn_in, targets)
        self.items = len(samples)
        pad = ((0, 1), (0, 0))
        self.samples, self.points = (self.tensor(np.pad(x, pad)) for x in (samples, points))
        self.targets = self.tensor(np.pad(rows, pad, constant_values=len(problem.r)))
        self.weights = self.tensor(np.pad(told(weights, problem), ((0, 0), (0, 1))))
        self.r = self.tensor(np.pad(problem.r, pad))
        self.G = self.tensor(np.pad(problem.G, ((0, 1), (0, 0), (0, 0))))
        self.coefficients = [float(c) for c in problem.coefficients]
        seen = law.seen(theta[:, None], nodes.inputs)
        parts = [by_fold(s, theta, k) for s, k in zip(seen, (2, 2, 1, 1), strict=True)]
        self.z, self.own, self.share, self.sign = map(self.tensor, parts)
        self.before = self.tensor(np.arange(self.folds) * len(nodes.time))[:, None, None]
        self._rows = rows

    def tensor(self, values: Array) -> Tensor:
        """Values on the device; a copy."""
        return torch.tensor(values, device=self.device)

    def counted(self, weights: Array) -> Array:
        """Which pieces (F, C) hold rows that count under weights (F, K)."""
        return (np.pad(weights, ((0, 0), (0, 1)))[:, self._rows] > 0).any(axis=2)

    def cost(self, theta: Tensor, items: Tensor) -> Tensor:
        """Weighted squares (F,) of the pieces (F, B)."""
        z = self._taken(self.z, self.samples[items])  # (F, B, T, n, a)
        points = self.points[items]
        own, share, sign = (self._taken(s, points) for s in (self.own, self.share, self.sign))
        level = self._level(theta, z, own, share, points.shape[-1])
        torque = level * sign
        width = self.per * (self.rows - 1) + 1
        mean = sum(
            c * torque[:, :, m : m + width : self.per] for m, c in enumerate(self.coefficients)
        )
        rows = self.targets[items]
        e = self.r[rows] - (self.G[rows] * mean[..., None, :]).sum(-1)
        weights = self.weights.gather(1, rows.flatten(1)).unflatten(1, rows.shape[1:])
        return (weights * (e * e).sum(-1)).sum((1, 2)) / (items.shape[1] * self.rows)

    def _taken(self, values: Tensor, index: Tensor) -> Tensor:
        flat = (index + self.before).flatten()
        return values.index_select(0, flat).unflatten(0, index.shape)

    def _level(self, theta: Tensor, z: Tensor, own: Tensor, share: Tensor, points: int) -> Tensor:
        """Level (F, B, points, n); cells of odd laws read the motion and its mirror image."""
        signs = (1.0, -1.0) if self.law.odd else (1.0,)
        both = torch.cat([sign * z for sign in signs], dim=1)
        h = self._cells(theta, both)[:, :, self.burn_in :]
        h = h.repeat_interleave(self.per, dim=2)[:, :, :points]
        parts = []
        for part in h.chunk(len(signs), dim=1):
            features = torch.cat([own, part], dim=-1).flatten(1, 2)
            level = self.law.level(theta[:, None], features, share.flatten(1, 2))
            parts.append(level.unflatten(1, share.shape[1:3]))
        return sum(parts) / len(parts)

    def _cells(self, theta: Tensor, z: Tensor) -> Tensor:
        """Outputs (F, B, T, n, cells) of the cells that read z (F, B, T, n, a)."""
        a, b = self.law.gate_sizes
        F, B, T, n, inputs = z.shape
        row = theta[..., 3 : 3 + count(self.law.gate_sizes)].flatten(0, 1)
        W, offset = row[:, : a * b].unflatten(1, (a, b)), row[:, None, a * b :]
        by_set = z.permute(0, 3, 2, 1, 4).reshape(F * n, T * B, inputs)
        read = torch.baddbmm(offset, by_set, W[:, :inputs]).unflatten(1, (T, B))
        h = _Cells.apply(read.transpose(0, 1), W[:, inputs:])  # (T, F n, B, H)
        return h.unflatten(1, (F, n)).permute(1, 3, 0, 2, 4)


class _Cells(torch.autograd.Function):
    """Outputs (T, S, B, H) of S sets of cells from what they read (T, S, B, 4 H)."""

    @staticmethod
    def forward(ctx: Any, read: Tensor, W: Tensor) -> Tensor:
        T, S, B, H = read.shape[0], read.shape[1], read.shape[2], W.shape[1]
        gates = torch.empty(T, S, B, 4 * H, dtype=read.dtype, device=read.device)
        h = torch.zeros(T + 1, S, B, H, dtype=read.dtype, device=read.device)
        c, tanh = torch.zeros_like(h), torch.empty_like(h[1:])
        for t in range(T):
            gate = torch.baddbmm(read[t], h[t], W, out=gates[t])
            gate[..., : 3 * H].sigmoid_()
            gate[..., 3 * H :].tanh_()
            take, keep, give, new = gate.chunk(4, dim=-1)
            torch.mul(keep, c[t], out=c[t + 1]).addcmul_(take, new)
            torch.tanh(c[t + 1], out=tanh[t])
            torch.mul(give, tanh[t], out=h[t + 1])
        ctx.save_for_backward(gates, h, c, tanh, W)
        return h[1:]

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, Tensor]:
        gates, h, c, tanh, W = ctx.saved_tensors
        T, S, B, H = gates.shape[0], gates.shape[1], gates.shape[2], W.shape[1]
        take, keep, give, new = gates.chunk(4, dim=-1)
        by_output = give * (1 - tanh * tanh)
        by_content = torch.stack(
            [new * take * (1 - take), c[:-1] * keep * (1 - keep), take * (1 - new * new)], dim=3
        )
        by_give = tanh * give * (1 - give)
        back, dh = W.transpose(1, 2), slopes[0][T - 1]
        out = torch.empty(T, S, B, 4, H, dtype=gates.dtype, device=gates.device)
        dc = torch.zeros_like(dh)
        for t in range(T - 1, -1, -1):
            dc = torch.addcmul(dc, dh, by_output[t])
            torch.mul(dh, by_give[t], out=out[t, :, :, 2])
            torch.mul(dc[:, :, None], by_content[t, :, :, :2], out=out[t, :, :, :2])
            torch.mul(dc, by_content[t, :, :, 2], out=out[t, :, :, 3])
            dc = dc * keep[t]
            if t:
                dh = torch.baddbmm(slopes[0][t - 1], out[t].flatten(2), back)
        flat = out.flatten(3)
        before = h[:-1].transpose(0, 1).flatten(1, 2)
        by_weights = before.transpose(1, 2) @ flat.transpose(0, 1).flatten(1, 2)
        return flat, by_weights


def _pieces(problem: Problem, burn_in: int, targets: int) -> tuple[Array, Array, Array]:
    """Nodes (C, T) of the samples, nodes (C, P) of the targets, and their rows (C, targets).

    Samples before a recording's first, and after its last, repeat these; rows that are none are K.
    """
    nodes, per = problem.nodes, problem.nodes.per_sample
    reach = len(problem.coefficients) - 1  # nodes of a row beyond its first
    row_at = np.full(len(nodes.time), len(problem.r))
    row_at[problem.stencil[:, 0]] = np.arange(len(problem.r))
    length = burn_in + targets + reach // per
    samples, points, rows = [], [], []
    for first, end in zip(nodes.first[:-1], nodes.first[1:], strict=True):
        last = (end - first - 1) // per
        for begin in range(-burn_in, last - burn_in, targets):
            at = begin + np.arange(length)
            samples.append(first + per * np.clip(at, 0, last))
            point = per * (begin + burn_in) + np.arange(per * (targets - 1) + reach + 1)
            points.append(first + np.clip(point, 0, end - first - 1))
            start = begin + burn_in + np.arange(targets)
            known = row_at[first + per * np.clip(start, 0, last)]
            rows.append(np.where(start <= last, known, len(problem.r)))
    return np.stack(samples), np.stack(points), np.stack(rows)
