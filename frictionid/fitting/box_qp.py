"""Small quadratic problems within bounds, a whole stack at once."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array

_BLOCKS = 5  # turns in which all parameters may change sides together
_TURNS = 200


def bounded(H: Array, g: Array, low: Array, high: Array) -> Array:
    """Minimum d (B, N) of d'H d/2 - g'd within low <= d <= high, all (B, N).

    By block pivoting: parameters that leave their bounds are put there, and those that a bound need
    not hold are freed, all at once for a few turns, then one at a time, which ends [Portugal1994].
    H (B, N, N) is positive semidefinite; a parameter without influence stays nearest to zero.

    >>> H = np.array([[[2.0, 1.0], [1.0, 2.0]]])
    >>> bounded(H, np.array([[3.0, 0.0]]), np.array([[-1.0, 0.0]]), np.array([[5.0, 5.0]]))
    array([[1.5, 0. ]])
    """
    base = np.clip(np.zeros_like(g), low, high)
    g, low, high = g - np.einsum("bij,bj->bi", H, base), low - base, high - base
    eye = np.eye(g.shape[-1])
    side = np.where((low >= 0) & (g < 0), -1, np.where((high <= 0) & (g > 0), 1, 0))
    for turn in range(_TURNS):
        free = (side == 0) * 1.0
        held = np.select([side < 0, side > 0], [low, high], 0.0)
        A = H * free[:, :, None] * free[:, None, :]
        A = A + (np.einsum("bii->bi", A) <= 0)[:, :, None] * eye
        pull = (g - np.einsum("bij,bj->bi", H, held)) * free
        d = np.linalg.solve(A, pull[..., None])[..., 0] + held
        change = _change(side, d, g - np.einsum("bij,bj->bi", H, d), low, high)
        wrong = change != side
        if not wrong.any():
            break
        if turn >= _BLOCKS:
            wrong &= np.cumsum(wrong[:, ::-1], axis=1)[:, ::-1] == 1  # the last one only
        side = np.where(wrong, change, side)
    return np.asarray(base + np.clip(d, low, high))


def _change(side: Array, d: Array, slope: Array, low: Array, high: Array) -> Array:
    """Side that each parameter should be on: -1 at its lower bound, 1 at its upper, 0 between."""
    crossed = np.where(d < low, -1, np.where(d > high, 1, 0))
    return np.where(side == 0, crossed, np.where(side * slope < 0, 0, side))
