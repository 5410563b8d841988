"""Inertial parameters of the bodies: moved into the frame of the base, summed over subtrees."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.compiled import compiled


@compiled
def world_inertias(pi: Array, R: Array, o: Array) -> Array:
    """Inertial parameters (K, n, 10) about the origin of the base, see `spatial`.

    pi : array, shape (1, n, 10) or (K, n, 10), about the origin of each body's own frame
    R, o : frames of the bodies, see `kinematics.placements`
    """
    K, n = o.shape[0], o.shape[1]
    out = np.empty((K, n, 10))
    for k in range(K):
        row = k if len(pi) > 1 else 0
        for i in range(n):
            m, h0, h1, h2, a, b, c, d, e, f = pi[row, i]
            r = R[k, i]
            x, y, z = o[k, i]
            u0 = r[0, 0] * h0 + r[0, 1] * h1 + r[0, 2] * h2
            u1 = r[1, 0] * h0 + r[1, 1] * h1 + r[1, 2] * h2
            u2 = r[2, 0] * h0 + r[2, 1] * h1 + r[2, 2] * h2
            out[k, i, 0] = m
            out[k, i, 1], out[k, i, 2], out[k, i, 3] = u0 + m * x, u1 + m * y, u2 + m * z
            # (o + r)(o + r)' summed over the body, beyond r r'
            xx, yy, zz = (
                2.0 * x * u0 + m * x * x,
                2.0 * y * u1 + m * y * y,
                2.0 * z * u2 + m * z * z,
            )
            out[k, i, 5] = -(x * u1 + y * u0 + m * x * y)
            out[k, i, 6] = -(x * u2 + z * u0 + m * x * z)
            out[k, i, 8] = -(y * u2 + z * u1 + m * y * z)
            out[k, i, 4], out[k, i, 7], out[k, i, 9] = yy + zz, xx + zz, xx + yy
            for s in range(3):
                p0 = r[s, 0] * a + r[s, 1] * b + r[s, 2] * c
                p1 = r[s, 0] * b + r[s, 1] * d + r[s, 2] * e
                p2 = r[s, 0] * c + r[s, 1] * e + r[s, 2] * f
                for t in range(s, 3):
                    at = 4 + t if s == 0 else 5 + s + t
                    out[k, i, at] += p0 * r[t, 0] + p1 * r[t, 1] + p2 * r[t, 2]
    return out


@compiled
def composite(parent: Array, inertia: Array) -> Array:
    """Sums (K, n, c) of what each body has (K, n, c) over all bodies that its joint carries."""
    out = inertia.copy()
    K, n, count = out.shape
    for k in range(K):
        for i in range(n - 1, -1, -1):
            p = parent[i]
            if p >= 0:
                for c in range(count):
                    out[k, p, c] += out[k, i, c]
    return out
