"""LSTM cells for training: their loop over time forwards, and the gradients backwards, by hand.

What automatic differentiation would add to each small product is most of the time it takes.
"""

from __future__ import annotations

from typing import Any

import torch

from frictionid.fitting.networks.fold_stack import Tensor


class Cells(torch.autograd.Function):
    """Outputs (T - burn_in, S, H, B) of S sets of H cells that read (T, S, a, B) samples.

    With weights W (S, a + H + 1, 4 H) and the arguments of the gates

        [i, f, o, g] = W' [read_t, h_(t-1), 1]

    a sample changes contents c and outputs h, which begin at zero [Hochreiter1997]:

        c_t = sigmoid(f) c_(t-1) + sigmoid(i) tanh(g),   h_t = sigmoid(o) tanh(c_t)
    """

    @staticmethod
    def forward(ctx: Any, W: Tensor, read: Tensor, burn_in: int) -> Tensor:
        (T, S, a, B), H = read.shape, W.shape[2] // 4
        like = {"dtype": W.dtype, "device": W.device}
        x = torch.zeros(T + 1, S, a + H + 1, B, **like)  # [read_t, h_(t-1), 1]
        x[:T, :, :a], x[:, :, -1] = read, 1.0
        h, c = x[:, :, a:-1], torch.zeros(T + 1, S, H, B, **like)
        gates, tanh_c = torch.empty(T, S, 4 * H, B, **like), torch.empty(T, S, H, B, **like)
        W_t = W.transpose(1, 2)
        i, f, o, g = gates.chunk(4, dim=2)
        series = (x[:T], gates, gates[:, :, : 3 * H], i, f, o, g, c[:T], c[1:], tanh_c, h[1:])
        for x_t, all_t, ifo_t, i_t, f_t, o_t, g_t, c_before, c_t, tanh_t, h_t in zip(
            *(values.unbind() for values in series), strict=True
        ):
            torch.bmm(W_t, x_t, out=all_t)
            ifo_t.sigmoid_()
            g_t.tanh_()
            torch.mul(f_t, c_before, out=c_t).addcmul_(i_t, g_t)
            torch.tanh(c_t, out=tanh_t)
            torch.mul(o_t, tanh_t, out=h_t)
        ctx.save_for_backward(W, x, gates, c, tanh_c)
        return h[1 + burn_in :]

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        """dL/dW = sum_t x_t a_t' with a_t, the slopes in the arguments of the gates."""
        W, x, gates, c, tanh_c = ctx.saved_tensors
        a = _argument_slopes(W, gates, c, tanh_c, slopes[0])  # (T, S, 4 H, B)
        rows = x[:-1].permute(1, 2, 0, 3).flatten(2)
        return rows @ a.permute(1, 0, 3, 2).flatten(1, 2), None, None


def _argument_slopes(W: Tensor, gates: Tensor, c: Tensor, tanh_c: Tensor, slope: Tensor) -> Tensor:
    """Slopes a (T, S, 4 H, B) of the loss L in the arguments of the gates i, f, o and g.

    From the slopes dL/dh (T - burn_in, S, H, B) of the outputs, backwards in time: with i, f, o and
    g the values of the gates, the slopes in outputs and contents are

        dh_t = slope_t + W_h a_(t+1)
        dc_t = dh_t o (1 - tanh(c_t)^2) + f_(t+1) dc_(t+1)

    and those in the arguments

        a_t = [dc_t g i (1 - i), dc_t c_(t-1) f (1 - f), dh_t tanh(c_t) o (1 - o), dc_t i (1 - g^2)]
    """
    T, S, H, B = tanh_c.shape
    i, f, o, g = gates.chunk(4, dim=2)
    c_by_h = o * (1 - tanh_c * tanh_c)
    o_by_h = tanh_c * o * (1 - o)
    by_c = [g * i * (1 - i), c[:-1] * f * (1 - f), torch.zeros_like(o), i * (1 - g * g)]
    a = torch.empty(T, S, 4, H, B, dtype=W.dtype, device=W.device)
    series = (a, a[:, :, 2], a.flatten(2, 3), torch.stack(by_c, dim=2), c_by_h, o_by_h, f)
    steps = list(zip(*(values.unbind() for values in series), strict=True))
    W_h, burn_in = W[:, -1 - H : -1], T - len(slope)
    dh, dc = torch.zeros_like(tanh_c[0]), torch.zeros_like(tanh_c[0])
    for t in range(T - 1, -1, -1):
        a_t, a_o_t, flat_t, by_c_t, c_by_h_t, o_by_h_t, f_t = steps[t]
        if t >= burn_in:
            dh += slope[t - burn_in]
        dc.addcmul_(dh, c_by_h_t)
        torch.mul(by_c_t, dc[:, None], out=a_t)
        torch.mul(dh, o_by_h_t, out=a_o_t)
        dc *= f_t
        dh = torch.bmm(W_h, flat_t)
    return a.flatten(2, 3)
