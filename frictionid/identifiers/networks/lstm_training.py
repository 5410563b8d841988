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
from frictionid.friction.laws.layers import count
from frictionid.identifiers.networks.mlp_training import Tensor, by_fold, told
from frictionid.identifiers.residual import Problem


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
        of = law.features(theta[:, None], nodes.inputs)
        parts = ((of.read, 2), (of.z, 2), (of.share, 1), (of.sign, 1))
        tensors = [self.tensor(by_fold(part, theta, axes)) for part, axes in parts]
        self.z, self.own, self.share, self.sign = tensors
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
        h = self._cells(theta, both)
        h = h.repeat_interleave(self.per, dim=2)[:, :, :points]
        parts = []
        for part in h.chunk(len(signs), dim=1):
            features = torch.cat([own, part], dim=-1).flatten(1, 2)
            level = self.law.level(theta[:, None], features, share.flatten(1, 2))
            parts.append(level.unflatten(1, share.shape[1:3]))
        return sum(parts) / len(parts)

    def _cells(self, theta: Tensor, z: Tensor) -> Tensor:
        """Outputs (F, B, T - burn_in, n, cells) of the cells that read z (F, B, T, n, a)."""
        a, b = self.law.gate_sizes
        row = theta[..., 3 : 3 + count(self.law.gate_sizes)].flatten(0, 1)
        read = z.permute(2, 0, 3, 4, 1).flatten(1, 2)  # (T, F n, a, B)
        h = _Cells.apply(row.unflatten(1, (a + 1, b)), read, self.burn_in)  # (T, F n, H, B)
        return h.unflatten(1, theta.shape[:2]).permute(1, 4, 0, 2, 3)


class _Cells(torch.autograd.Function):
    """Outputs (T - burn_in, S, H, B) of S sets of cells that read (T, S, a, B).

    Weights W (S, a + H + 1, 4 H) are those of what is read, of the outputs before, and offsets;
    gates stand as in `LSTM`. What is in a row of a matrix lies side by side in memory.
    """

    @staticmethod
    def forward(ctx: Any, W: Tensor, read: Tensor, burn_in: int) -> Tensor:
        (T, S, a, B), H = read.shape, W.shape[2] // 4
        new = {"dtype": W.dtype, "device": W.device}
        x = torch.zeros(T + 1, S, a + H + 1, B, **new)
        x[:T, :, :a], x[:, :, -1] = read, 1.0
        gates, c = torch.empty(T, S, 4 * H, B, **new), torch.zeros(T + 1, S, H, B, **new)
        tanh, forth = torch.empty(T, S, H, B, **new), W.transpose(1, 2)
        h = x[:, :, a:-1]
        parts = gates.chunk(4, dim=2)
        loop = (x, gates, gates[:, :, : 3 * H], *parts, c, c[1:], tanh, h[1:])
        for x_t, gate, three, take, keep, give, fresh, old, now, bent, h_t in zip(
            *(part.unbind() for part in loop), strict=False
        ):
            torch.bmm(forth, x_t, out=gate)
            three.sigmoid_()
            fresh.tanh_()
            torch.mul(keep, old, out=now).addcmul_(take, fresh)
            torch.tanh(now, out=bent)
            torch.mul(give, bent, out=h_t)
        ctx.save_for_backward(W, x, gates, c, tanh)
        return h[1 + burn_in :]

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        W, x, gates, c, tanh = ctx.saved_tensors
        (T, S, H, B), slope = tanh.shape, slopes[0]
        take, keep, give, fresh = gates.chunk(4, dim=2)
        by_output = give * (1 - tanh * tanh)
        by_content = torch.stack(
            [
                fresh * take * (1 - take),
                c[:-1] * keep * (1 - keep),
                torch.zeros_like(keep),
                take * (1 - fresh * fresh),
            ],
            dim=2,
        )
        by_give = tanh * give * (1 - give)
        out = torch.empty(T, S, 4, H, B, dtype=W.dtype, device=W.device)
        flat, back = out.flatten(2, 3), W[:, -1 - H : -1]
        dh, dc = slope[-1], torch.zeros_like(tanh[0])
        given = slope.unbind()
        loop = (out, out[:, :, 2], flat, by_output, by_content, by_give, keep)
        steps = list(zip(*(part.unbind() for part in loop), strict=True))
        for t in range(T - 1, -1, -1):
            all_t, give_t, flat_t, by_output_t, by_content_t, by_give_t, keep_t = steps[t]
            dc.addcmul_(dh, by_output_t)
            torch.mul(by_content_t, dc[:, None], out=all_t)
            torch.mul(dh, by_give_t, out=give_t)
            if not t:
                break
            dc *= keep_t
            before = t - 1 - (T - len(given))
            dh = torch.bmm(back, flat_t)
            if before >= 0:
                dh += given[before]
        met = x[:T].permute(1, 2, 0, 3).flatten(2)
        return met @ flat.permute(1, 0, 3, 2).flatten(1, 2), None, None


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
