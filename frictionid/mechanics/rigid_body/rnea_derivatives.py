"""Partial derivatives of the torques of a motion by angles and velocities [Singh2022].

With the carried inertia I, force f and B of each joint, dS = v_p x S and ddS = a_p x S + v_p x dS,
and i on the way from the base to k (or k itself),

    dtau_i/dq_k = S_i' (2 B_k dS_k + I_k ddS_k + S_k x* f_k)
    dtau_k/dq_i = S_k' (2 B_k dS_i + I_k ddS_i)
    dtau_i/dw_k = S_i' (2 B_k S_k + 2 I_k dS_k)
    dtau_k/dw_i = S_k' (2 B_k S_i + 2 I_k dS_i)

Of a body with inertia J about the origin, first moment h and momentum p, 2 B x has the moment N x
and the force -2 p x x of the angular part of x alone, N = -2 ([w] (tr J / 2 - J) + [h] [v]),
and [h] [v] = v h' - h'v.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.compiled import compiled, inlined
from frictionid.mechanics.rigid_body.spatial import (
    add_cross_force,
    body_force,
    cross_motion,
    dot,
    momentum,
)


@inlined
def _coriolis(inertia: Any, v: Any, moving: Any, out: Any) -> None:
    """2 B of one body: N (9 numbers) and 2 p (3 numbers); `moving` is its momentum."""
    trace = inertia[4] + inertia[7] + inertia[9]
    xx, yy, zz = trace / 2 - inertia[4], trace / 2 - inertia[7], trace / 2 - inertia[9]
    xy, xz, yz = -inertia[5], -inertia[6], -inertia[8]
    power = 2.0 * (inertia[1] * v[3] + inertia[2] * v[4] + inertia[3] * v[5])
    for c in range(3):
        s0, s1, s2 = (xx, xy, xz) if c == 0 else ((xy, yy, yz) if c == 1 else (xz, yz, zz))
        h = inertia[1 + c]
        out[c] = -2.0 * (v[1] * s2 - v[2] * s1 + v[3] * h)
        out[3 + c] = -2.0 * (v[2] * s0 - v[0] * s2 + v[4] * h)
        out[6 + c] = -2.0 * (v[0] * s1 - v[1] * s0 + v[5] * h)
        out[4 * c] += power
        out[9 + c] = 2.0 * moving[3 + c]


@inlined
def _add_coriolis(B: Any, x: Any, out: Any) -> None:
    """Add 2 B x."""
    out[0] += B[0] * x[0] + B[1] * x[1] + B[2] * x[2]
    out[1] += B[3] * x[0] + B[4] * x[1] + B[5] * x[2]
    out[2] += B[6] * x[0] + B[7] * x[1] + B[8] * x[2]
    out[3] += x[1] * B[11] - x[2] * B[10]
    out[4] += x[2] * B[9] - x[0] * B[11]
    out[5] += x[0] * B[10] - x[1] * B[9]


@inlined
def _transposed(B: Any, x: Any, out: Any) -> None:
    """(2 B)' x, of which only the first three numbers are not zero."""
    out[0] = B[0] * x[0] + B[3] * x[1] + B[6] * x[2] + B[10] * x[5] - B[11] * x[4]
    out[1] = B[1] * x[0] + B[4] * x[1] + B[7] * x[2] + B[11] * x[3] - B[9] * x[5]
    out[2] = B[2] * x[0] + B[5] * x[1] + B[8] * x[2] + B[9] * x[4] - B[10] * x[3]


@compiled
def torque_derivatives(
    parent: Array, gravity: Array, S: Array, v: Array, dS: Array, a: Array, inertia: Array
) -> tuple[Array, Array]:
    """Derivatives by q and by w (K, n, n) of the torques of a motion, see `rnea.torques`."""
    K, n = S.shape[0], S.shape[1]
    by_q, by_w = np.zeros((K, n, n)), np.zeros((K, n, n))
    J, B, f = np.empty((n, 10)), np.empty((n, 12)), np.empty((n, 6))
    twice, base = np.empty((n, 6)), np.zeros(6)
    x, y, row, inert = np.empty(6), np.empty(6), np.zeros(6), np.empty(6)
    base[3:] = -gravity
    for k in range(K):
        for i in range(n):
            p = parent[i]
            J[i] = inertia[k, i]
            body_force(J[i], v[k, i], a[k, i], x, f[i])
            _coriolis(J[i], v[k, i], x, B[i])
            cross_motion(a[k, p] if p >= 0 else base, S[k, i], twice[i])
            if p >= 0:
                cross_motion(v[k, p], dS[k, i], x)
                twice[i] += x
        for i in range(n - 1, -1, -1):
            momentum(J[i], twice[i], x)
            _add_coriolis(B[i], dS[k, i], x)
            add_cross_force(S[k, i], f[i], x)
            momentum(J[i], dS[k, i], y)
            y *= 2.0
            _add_coriolis(B[i], S[k, i], y)
            _transposed(B[i], S[k, i], row)
            momentum(J[i], S[k, i], inert)
            j = i
            while j >= 0:
                by_q[k, j, i], by_w[k, j, i] = dot(S[k, j], x), dot(S[k, j], y)
                if j != i:
                    by_q[k, i, j] = dot(dS[k, j], row) + dot(twice[j], inert)
                    by_w[k, i, j] = dot(S[k, j], row) + 2.0 * dot(dS[k, j], inert)
                j = parent[j]
            p = parent[i]
            if p >= 0:
                J[p] += J[i]
                B[p] += B[i]
                f[p] += f[i]
    return by_q, by_w
