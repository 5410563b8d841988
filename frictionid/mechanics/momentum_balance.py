"""The momentum balance over sample intervals, which needs no acceleration.

    M1 w1 - M0 w0 = integral of (dL/dq + B u - Tf) dt     [N m s]

The integral is Simpson's rule along the estimated motion, with the midpoint of the cubic Hermite
polynomial through both ends. The balance is linear in the base parameters and in friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.mechanics.mechanism import Terms

# Weights of start, midpoint and end of an interval.
SIMPSON = (1 / 6, 4 / 6, 1 / 6)


class Balance(NamedTuple):
    """Terms of the balance without input and friction, (..., K, n) each.

    start, end : M0 w0 and M1 w1 [N m s] ; force : mean of dL/dq [N m]
    """

    start: Array
    end: Array
    force: Array


def with_midpoints(time: Array, q: Array, w: Array) -> tuple[Array, Array, Array]:
    """Time (2K + 1,), q and w (2K + 1, n) of K + 1 samples with the midpoints between them.

    q_mid = (q0 + q1)/2 + (w0 - w1) dt/8,    w_mid = 1.5 (q1 - q0)/dt - (w0 + w1)/4

    >>> t = np.array([0.0, 2.0])
    >>> [x.ravel().tolist() for x in with_midpoints(t, t[:, None] ** 3, 3 * t[:, None] ** 2)]
    [[0.0, 1.0, 2.0], [0.0, 1.0, 8.0], [0.0, 3.0, 12.0]]
    """
    dt = np.diff(time)
    h = dt[:, None]
    middle_q = (q[1:] + q[:-1]) / 2 + (w[:-1] - w[1:]) * h / 8
    middle_w = 1.5 * (q[1:] - q[:-1]) / h - (w[1:] + w[:-1]) / 4
    middle = (time[:-1] + dt / 2, middle_q, middle_w)
    t, q, w = (interleaved(*pair) for pair in zip((time, q, w), middle, strict=True))
    return t, q, w


def interleaved(samples: Array, middle: Array) -> Array:
    """Values at K + 1 samples and K midpoints as one series (2K + 1, ...)."""
    out = np.empty((len(samples) + len(middle), *samples.shape[1:]))
    out[::2], out[1::2] = samples, middle
    return out


def interval_stencil(samples: int, first: int = 0) -> Array:
    """Indices (K, 3) of start, midpoint and end of the intervals between K + 1 samples.

    first : index of the first sample in the series of samples and midpoints

    >>> interval_stencil(3)
    array([[0, 1, 2],
           [2, 3, 4]])
    """
    return first + 2 * np.arange(samples - 1)[:, None] + np.arange(3)


def interval_mean(
    values: Array, stencil: Array, weights: Sequence[float] | Array = SIMPSON
) -> Array:
    """Means (..., K, n) over intervals, sum_m weights[m] values[..., stencil[:, m], :]."""
    first, *others = (
        c * values[..., _as_slice(index), :] for c, index in zip(weights, stencil.T, strict=True)
    )
    mean: Any = first
    for part in others:
        mean += part
    return mean


def _as_slice(index: Array) -> Any:
    """Evenly spaced indices as a slice, which copies nothing; others as they are."""
    if len(index) < 2:
        return index
    step = int(index[1] - index[0])
    even = step > 0 and (index[1:] - index[:-1] == step).all()
    return slice(int(index[0]), int(index[-1]) + 1, step) if even else index


def momentum_balance(terms: Terms, stencil: Array) -> Balance:
    """Balance over K intervals of the terms of the equations of motion along the nodes.

    Parameters
    ----------
    terms : Terms at S nodes, samples and midpoints; batch axes may stand before them
    stencil : array, shape (K, 3), nodes of each interval, see `interval_stencil`
    """
    start, middle, end = stencil.T
    f = terms.dLdq
    force = (f[..., start, :] + 4 * f[..., middle, :] + f[..., end, :]) / 6
    return Balance(terms.momentum[..., start, :], terms.momentum[..., end, :], force)
