"""Recurrent cells as compiled loops along the samples, and their slopes backwards in time.

A few cells of a few pieces of recordings are so little work that the calls of PyTorch take most of
the time: these loops take a tenth of it. Other devices than the processor have `cells`.
"""

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import needs
from frictionid.programs.machine_code import compiled, inlined

with needs("networks"):
    import torch

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
    """The same as `cells`, on the processor."""

    @staticmethod
    def forward(ctx: Any, W: Any, read: Any, burn_in: int) -> Any:
        (F, B, T, n, _), H = read.shape, W.shape[-1] // 4
        weights, samples = W.detach().numpy(), np.ascontiguousarray(read.numpy())
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
