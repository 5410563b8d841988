"""Memories that relax towards a target, scanned along recorded time by compiled code.

    z_(k+1) = target_k + (z_k - target_k) keep_k

depends on the memory before alone, so that target and keep of all steps are computed at once.
"""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.loops import compiled


def relaxed(target: Array, keep: Array, start: Array, first: Array) -> Array:
    """Memory (..., S, n) at the nodes of recordings, from its start (..., R, n) in each.

    target, keep : (..., S - 1, n), of the step behind each node
    first : (R + 1,), recording i owns nodes first[i] to first[i + 1]

    >>> target, start = np.ones((3, 1)), np.zeros((2, 1))
    >>> relaxed(target, 0.5 * target, start, np.array([0, 3, 4])).ravel()
    array([0.  , 0.5 , 0.75, 0.  ])
    """
    *batch, steps, n = np.broadcast_shapes(target.shape, keep.shape)
    batch = list(np.broadcast_shapes(tuple(batch), start.shape[:-2]))
    flat = (np.broadcast_to(x, (*batch, *x.shape[-2:])) for x in (target, keep, start))
    shaped = [np.broadcast_to(x, (*x.shape[:-1], n)).reshape(-1, x.shape[-2], n) for x in flat]
    out = np.asarray(_scanned(*(np.ascontiguousarray(x, float) for x in shaped), first))
    return out.reshape(*batch, steps + 1, n)


@compiled
def _scanned(target: Array, keep: Array, start: Array, first: Array) -> Array:
    B, steps, n = target.shape
    out = np.empty((B, steps + 1, n))
    for b in range(B):
        for r in range(len(first) - 1):
            for j in range(n):
                z = start[b, r, j]
                out[b, first[r], j] = z
                for k in range(first[r], first[r + 1] - 1):
                    z = target[b, k, j] + (z - target[b, k, j]) * keep[b, k, j]
                    out[b, k + 1, j] = z
    return out
