"""Windows of intervals: chained into predictions from their start, and start states eliminated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.shooting.intervals import Track
from frictionid.shooting.linearise import Lines

_WILD = 1e4  # [rad per rad or rad/s of its start]: a prediction that tells nothing
_FAR = 1e3  # [rad]


class Chain(NamedTuple):
    """What W windows of at most N intervals predict, linear in starts and parameters.

    error (W, N + 1, n) [rad]: measured minus predicted angle, as if all samples had the usual
    noise; slope (W, N + 1, n, 2n + D): of the
    predicted angle, in the window's start state and the parameters; share (W, N + 1): how much a
    sample counts, half where it belongs to two windows, nothing where there is none.
    moved (W, N, s): how far nodes are from where their window's own prediction passes;
    carried (W, N, s, 2n + D): its derivatives.
    """

    error: Array
    slope: Array
    share: Array
    moved: Array
    carried: Array


@np.errstate(over="ignore", invalid="ignore")
def chained(track: Track, lines: Lines, nodes: Array, windows: Array, offset: Array) -> Chain:
    """Windows (W, N) of intervals that each begin at its own node (K, s), made continuous.

    The prediction from the window's start passes node k + 1 at x_{k+1} + g_{k+1} with
    g_{k+1} = F_k - x_{k+1} + P_k g_k to first order in the gaps F_k - x_{k+1}; when they have
    closed, it is exactly the prediction from the start [Bock1983].

    Windows that explode (a law with numbers that make it steep) stay as they are: their predictions
    are far off, and nothing moves them until the parameters are better.
    """
    n, s = track.n, nodes.shape[1]
    W, N = windows.shape
    D = lines.by.shape[-1]
    on = windows >= 0
    index = np.where(on, windows, 0)
    last = on & ~np.concatenate([on[:, 1:], np.zeros((W, 1), bool)], axis=1)
    error, share = np.zeros((W, N + 1, n)), np.zeros((W, N + 1))
    slope = np.zeros((W, N + 1, n, 2 * n + D))
    moved, carried = np.zeros((W, N, s)), np.zeros((W, N, s, 2 * n + D))
    trust = np.ones((W, N + 1, n))
    g, T = np.zeros((W, s)), np.zeros((W, s, 2 * n + D))
    T[:, : 2 * n, : 2 * n] = np.eye(2 * n)
    for k in range(N):
        i, use, end = index[:, k], on[:, k], last[:, k]
        moved[:, k], carried[:, k] = g, T
        error[use, k] = (track.before[i] - offset - nodes[i, :n] - g[:, :n])[use]
        slope[use, k] = T[use, :n]
        trust[use, k] = track.trust_before[i][use]
        share[use, k] = 1.0 if k else 0.5
        P = lines.by_start[i]
        follows = np.where(end, i, index[:, min(k + 1, N - 1)])
        gap = np.where(end[:, None], 0.0, lines.end[i] - nodes[follows])
        g = (P @ g[..., None])[..., 0] + gap
        T = P @ T
        T[..., 2 * n :] += lines.by[i]
        at = lines.end[i, :n] + g[:, :n]
        error[end, k + 1] = (track.after[i] - offset - at)[end]
        slope[end, k + 1] = T[end, :n]
        trust[end, k + 1] = track.trust_after[i][end]
        share[end, k + 1] = 0.5
    slope[..., 2 * n :] += lines.angle.T * (share > 0)[..., None, None]
    if (trust != 1.0).any():
        error, slope = error * trust, slope * trust[..., None]
    return _tamed(Chain(error, slope, share, moved, carried))


def _tamed(chain: Chain) -> Chain:
    """The chain with windows that explode held where they are."""
    n = chain.error.shape[-1]
    steep = np.abs(chain.slope[..., : 2 * n]).max(axis=(1, 2, 3))
    known = np.isfinite(chain.slope).all(axis=(1, 2, 3)) & np.isfinite(chain.carried).all((1, 2, 3))
    tame = known & (steep < _WILD) & (np.abs(chain.error).max(axis=(1, 2)) < _FAR)
    if tame.all():
        return chain
    far = _FAR * (chain.share[..., None] > 0)
    rows = ~tame[:, None, None]
    return chain._replace(
        error=np.where(rows, far, chain.error),
        slope=np.where(rows[..., None], 0.0, chain.slope),
        moved=np.where(rows, 0.0, chain.moved),
        carried=np.where(rows[..., None], 0.0, chain.carried),
    )


class Normal(NamedTuple):
    """Normal equations of each window, its start state eliminated.

    H (W, D, D), g (W, D) of the shared parameters; to_start (W, 2n, D) and start (W, 2n): the best
    start moves by start - to_start step. leverage (W, N + 1, n): share of each residual that the
    window's own start takes up.
    """

    H: Array
    g: Array
    to_start: Array
    start: Array
    leverage: Array


def eliminated(
    chain: Chain, weight: Array, sigma: Array, prior: Array, damping: Array | None = None
) -> Normal:
    """Schur complements of the windows.

    weight (W, N + 1, n), sigma (n,) [rad]; prior (2, W, 2n): the start's wanted move, and its
    precision; damping (W, 2n), more precision for its step alone
    """
    W = len(chain.error)
    root = np.sqrt(weight * chain.share[..., None]) / sigma
    D = chain.slope.shape[-1]
    A = (chain.slope * root[..., None]).reshape(W, -1, D)
    b = (chain.error * root).reshape(W, -1)
    size = prior.shape[-1]
    own, shared = A[..., :size], A[..., size:]
    turned = np.swapaxes(own, 1, 2)
    wanted, precision = prior
    start = turned @ own + precision[:, :, None] * np.eye(size)
    start_right = (turned @ b[..., None])[..., 0] + precision * wanted
    inverse = np.linalg.inv(start)
    cross = turned @ shared
    to_start = inverse @ cross
    best = (inverse @ start_right[..., None])[..., 0]
    # as a sum of squares: a difference of large ones may come out negative
    rest = shared - own @ to_start
    H = np.swapaxes(rest, 1, 2) @ rest
    H += np.swapaxes(to_start, 1, 2) @ (precision[:, :, None] * to_start)
    g = np.einsum("wkd,wk->wd", rest, b) - np.einsum("wsd,ws->wd", to_start, precision * wanted)
    leverage = np.einsum("wks,wst,wkt->wk", own, inverse, own).reshape(root.shape)
    if damping is not None:
        held = start + damping[:, :, None] * np.eye(size)
        to_start = np.linalg.solve(held, cross)
        best = np.linalg.solve(held, start_right[..., None])[..., 0]
    return Normal(H, g, to_start, best, leverage)
