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

from frictionid.mechanics.rigid_body.inertia import add_to_parents
from frictionid.mechanics.rigid_body.spatial import (
    cross_force,
    cross_motion,
    dot,
    momentum,
)
from frictionid.programs.loops import inlined


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
    out[9], out[10], out[11] = 2.0 * moving[3], 2.0 * moving[4], 2.0 * moving[5]


@inlined
def _times(B: Any, x: Any) -> Any:
    """2 B x."""
    return (
        B[0] * x[0] + B[1] * x[1] + B[2] * x[2],
        B[3] * x[0] + B[4] * x[1] + B[5] * x[2],
        B[6] * x[0] + B[7] * x[1] + B[8] * x[2],
        x[1] * B[11] - x[2] * B[10],
        x[2] * B[9] - x[0] * B[11],
        x[0] * B[10] - x[1] * B[9],
    )


@inlined
def _transposed_times(B: Any, x: Any) -> Any:
    """(2 B)' x, of which only the first three numbers are not zero."""
    return (
        B[0] * x[0] + B[3] * x[1] + B[6] * x[2] + B[10] * x[5] - B[11] * x[4],
        B[1] * x[0] + B[4] * x[1] + B[7] * x[2] + B[11] * x[3] - B[9] * x[5],
        B[2] * x[0] + B[5] * x[1] + B[8] * x[2] + B[9] * x[4] - B[10] * x[3],
    )


@inlined
def prepare(tree: Any, S: Any, v: Any, dS: Any, a: Any, inertia: Any, B: Any, twice: Any) -> None:
    """Write 2 B (n, 12) of all that each joint carries, and ddS (n, 6)."""
    for i in range(len(S)):
        p = tree.parent[i]
        _coriolis(inertia[i], v[i], momentum(inertia[i], v[i]), B[i])
        if p >= 0:
            first, second = cross_motion(a[p], S[i]), cross_motion(v[p], dS[i])
            for c in range(6):
                twice[i, c] = first[c] + second[c]
        else:
            g = tree.gravity
            first = cross_motion((0.0, 0.0, 0.0, -g[0], -g[1], -g[2]), S[i])
            for c in range(6):
                twice[i, c] = first[c]
    add_to_parents(tree.parent, B, 12)


@inlined
def torque_derivatives(
    parent: Any, S: Any, dS: Any, twice: Any, J: Any, B: Any, f: Any, by_q: Any, by_w: Any
) -> None:
    """Write the derivatives by q and by w (n, n) of the torques of a motion, see `rnea.torques`.

    J, B, f, twice : inertia (n, 10), 2 B and force (n, 6) of all that each joint carries, and ddS
    """
    by_q[:], by_w[:] = 0.0, 0.0
    for i in range(len(parent)):
        x0, x1, x2 = momentum(J[i], twice[i]), _times(B[i], dS[i]), cross_force(S[i], f[i])
        y0, y1 = momentum(J[i], dS[i]), _times(B[i], S[i])
        x = (
            x0[0] + x1[0] + x2[0],
            x0[1] + x1[1] + x2[1],
            x0[2] + x1[2] + x2[2],
            x0[3] + x1[3] + x2[3],
            x0[4] + x1[4] + x2[4],
            x0[5] + x1[5] + x2[5],
        )
        y = (
            2.0 * y0[0] + y1[0],
            2.0 * y0[1] + y1[1],
            2.0 * y0[2] + y1[2],
            2.0 * y0[3] + y1[3],
            2.0 * y0[4] + y1[4],
            2.0 * y0[5] + y1[5],
        )
        row, inert = _transposed_times(B[i], S[i]), momentum(J[i], S[i])
        by_q[i, i], by_w[i, i] = dot(S[i], x), dot(S[i], y)
        j = parent[i]
        while j >= 0:
            d, s = dS[j], S[j]
            by_q[j, i], by_w[j, i] = dot(s, x), dot(s, y)
            turned = row[0] * d[0] + row[1] * d[1] + row[2] * d[2]
            by_q[i, j] = turned + dot(twice[j], inert)
            turned = row[0] * s[0] + row[1] * s[1] + row[2] * s[2]
            by_w[i, j] = turned + 2.0 * dot(d, inert)
            j = parent[j]
