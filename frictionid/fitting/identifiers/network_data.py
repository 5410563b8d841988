"""What networks are trained on, as tensors: stacked folds, rows, and pieces of recordings.

Cells of recurrent networks read some samples before the rows that count, to fill their memory.

On the processor they are compiled loops along the samples, with their slopes backwards in time: a
few cells of a few pieces are so little work that the calls of PyTorch take ten times as long.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError, needs
from frictionid.friction import Friction, Nodes, memory_at_nodes
from frictionid.friction.laws.layers import count
from frictionid.friction.laws.network_law import NetworkLaw
from frictionid.programs.machine_code import compiled, inlined

from ..one_step.residual import Problem

with needs("networks"):
    import torch

Tensor = Any  # of torch
_FAR = 20.0  # there tanh is one


def cells(W: Any, read: Any, burn_in: int) -> Any:
    """Outputs (F, B, T - burn_in, n, H) of the cells of n joints that read (F, B, T, n, a) samples.

    With weights W (F, n, a + H + 1, 4 H) and the arguments of the gates

        [i, f, o, g] = W' [read_t, h_(t-1), 1]

    a sample changes contents c and outputs h, which begin at zero [Hochreiter1997]:

        c_t = sigmoid(f) c_(t-1) + sigmoid(i) tanh(g),   h_t = sigmoid(o) tanh(c_t)
    """
    samples = read.permute(2, 0, 3, 1, 4)  # (T, F, n, B, a)
    c = read.new_zeros(*samples.shape[1:4], W.shape[-1] // 4)
    h, constant, outputs = c, torch.ones_like(c[..., :1]), []
    for x in samples:
        i, f, o, g = (torch.cat([x, h, constant], dim=-1) @ W).chunk(4, dim=-1)
        c = f.sigmoid() * c + i.sigmoid() * g.tanh()
        h = o.sigmoid() * c.tanh()
        outputs.append(h)
    return torch.stack(outputs[burn_in:]).permute(1, 3, 0, 2, 4)


class CompiledCells(torch.autograd.Function):
    """`cells` on the processor."""

    @staticmethod
    def forward(ctx: Any, W: Any, read: Any, burn_in: int) -> Any:
        (F, B, T, n, _), H = read.shape, W.shape[-1] // 4
        weights, samples = (np.ascontiguousarray(x.detach().numpy()) for x in (W, read))
        gates, contents = np.empty((F, B, n, T, 4 * H)), np.empty((F, B, n, T + 1, 2 * H))
        h = np.empty((F, B, T, n, H))
        _forth(weights, samples, gates, contents, h)
        ctx.arrays = weights, samples, gates, contents, h
        return torch.from_numpy(h)[:, :, burn_in:]

    @staticmethod
    def backward(ctx: Any, *slopes: Any) -> tuple[Any, None, None]:
        by_weights = np.zeros_like(ctx.arrays[0])
        _back(*ctx.arrays, slopes[0].contiguous().numpy(), by_weights)
        return torch.from_numpy(by_weights), None, None


@inlined
def _tanh(x: float) -> float:
    """Lambert's continued fraction at x / 4, and doubled twice: 1e-10 off, without a branch."""
    x = min(max(x, -_FAR), _FAR) / 4.0
    s = x * x
    t = x * (135135.0 + s * (17325.0 + s * (378.0 + s)))
    t = t / (135135.0 + s * (62370.0 + s * (3150.0 + 28.0 * s)))
    t = 2.0 * t / (1.0 + t * t)
    return 2.0 * t / (1.0 + t * t)


@compiled
def _forth(W: Array, read: Array, gates: Array, contents: Array, h: Array) -> None:
    """Set the values of the gates i, f, o and g, contents c and tanh(c), and outputs h.

    gates (F, B, n, T, 4 H); contents (F, B, n, T + 1, 2 H); h (F, B, T, n, H)
    """
    F, B, T, n, a = read.shape
    H = W.shape[3] // 4
    y, x = np.empty(4 * H), np.zeros(a + H + 1)
    x[a + H] = 1.0
    for f in range(F):
        for b in range(B):
            for j in range(n):
                w, c = W[f, j], contents[f, b, j]
                c[0], x[a : a + H] = 0.0, 0.0
                for t in range(T):
                    for i in range(a):
                        x[i] = read[f, b, t, j, i]
                    y[:] = 0.0
                    for i in range(a + H + 1):
                        for k in range(4 * H):
                            y[k] += x[i] * w[i, k]
                    for k in range(3 * H):
                        y[k] = 0.5 + 0.5 * _tanh(0.5 * y[k])
                    for k in range(3 * H, 4 * H):
                        y[k] = _tanh(y[k])
                    gates[f, b, j, t] = y
                    for k in range(H):
                        c[t + 1, k] = y[H + k] * c[t, k] + y[k] * y[3 * H + k]
                        c[t + 1, H + k] = _tanh(c[t + 1, k])
                        x[a + k] = y[2 * H + k] * c[t + 1, H + k]
                        h[f, b, t, j, k] = x[a + k]


@compiled
def _back(
    W: Array, read: Array, gates: Array, contents: Array, h: Array, slope: Array, by_W: Array
) -> None:
    """Add the slopes in the weights, from those (F, B, T - burn_in, n, H) in the outputs."""
    F, B, T, n, a = read.shape
    H, burn_in = W.shape[3] // 4, T - slope.shape[2]
    y, dc, dh, x = np.empty(4 * H), np.empty(H), np.empty(H), np.zeros(a + H + 1)
    x[a + H] = 1.0
    for f in range(F):
        for j in range(n):
            w = np.ascontiguousarray(W[f, j, a : a + H].T)
            by_w = by_W[f, j]
            for b in range(B):
                c = contents[f, b, j]
                dc[:], dh[:] = 0.0, 0.0
                for t in range(T - 1, -1, -1):
                    g = gates[f, b, j, t]
                    if t >= burn_in:
                        for k in range(H):
                            dh[k] += slope[f, b, t - burn_in, j, k]
                    for k in range(H):
                        i, keep, o, new = g[k], g[H + k], g[2 * H + k], g[3 * H + k]
                        tanh_c = c[t + 1, H + k]
                        dc[k] += dh[k] * o * (1.0 - tanh_c * tanh_c)
                        y[k] = dc[k] * new * i * (1.0 - i)
                        y[H + k] = dc[k] * c[t, k] * keep * (1.0 - keep)
                        y[2 * H + k] = dh[k] * tanh_c * o * (1.0 - o)
                        y[3 * H + k] = dc[k] * i * (1.0 - new * new)
                        dc[k] *= keep
                    for i in range(a):
                        x[i] = read[f, b, t, j, i]
                    for k in range(H):
                        x[a + k] = h[f, b, t - 1, j, k] if t else 0.0
                    for i in range(a + H + 1):
                        for k in range(4 * H):
                            by_w[i, k] += x[i] * y[k]
                    dh[:] = 0.0
                    for k in range(4 * H):
                        for i in range(H):
                            dh[i] += y[k] * w[k, i]


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
