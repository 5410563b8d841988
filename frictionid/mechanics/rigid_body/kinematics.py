"""Frames, motions and inertias of the bodies of a tree, in compiled loops.

Everything is in the frame of the base, so that no later algorithm knows frames.
"""

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import inlined


@inlined
def dot(x: Any, f: Any) -> float:
    """Power of a force on a motion, x' f."""
    return x[0] * f[0] + x[1] * f[1] + x[2] * f[2] + x[3] * f[3] + x[4] * f[4] + x[5] * f[5]


@inlined
def cross_motion(v: Any, x: Any) -> Any:
    """Change of a motion x that is carried along by v: v x x."""
    return (
        v[1] * x[2] - v[2] * x[1],
        v[2] * x[0] - v[0] * x[2],
        v[0] * x[1] - v[1] * x[0],
        v[1] * x[5] - v[2] * x[4] + v[4] * x[2] - v[5] * x[1],
        v[2] * x[3] - v[0] * x[5] + v[5] * x[0] - v[3] * x[2],
        v[0] * x[4] - v[1] * x[3] + v[3] * x[1] - v[4] * x[0],
    )


@inlined
def cross_force(v: Any, f: Any) -> Any:
    """Change of a force f that is carried along by v: v x* f."""
    return (
        v[1] * f[2] - v[2] * f[1] + v[4] * f[5] - v[5] * f[4],
        v[2] * f[0] - v[0] * f[2] + v[5] * f[3] - v[3] * f[5],
        v[0] * f[1] - v[1] * f[0] + v[3] * f[4] - v[4] * f[3],
        v[1] * f[5] - v[2] * f[4],
        v[2] * f[3] - v[0] * f[5],
        v[0] * f[4] - v[1] * f[3],
    )


@inlined
def momentum(inertia: Any, x: Any) -> Any:
    """Momentum of an inertia at the velocity x: I x."""
    m, h0, h1, h2 = inertia[0], inertia[1], inertia[2], inertia[3]
    return (
        inertia[4] * x[0] + inertia[5] * x[1] + inertia[6] * x[2] + h1 * x[5] - h2 * x[4],
        inertia[5] * x[0] + inertia[7] * x[1] + inertia[8] * x[2] + h2 * x[3] - h0 * x[5],
        inertia[6] * x[0] + inertia[8] * x[1] + inertia[9] * x[2] + h0 * x[4] - h1 * x[3],
        m * x[3] - h1 * x[2] + h2 * x[1],
        m * x[4] - h2 * x[0] + h0 * x[2],
        m * x[5] - h0 * x[1] + h1 * x[0],
    )


@inlined
def placements(tree: Any, q: Any, R: Any, o: Any, S: Any) -> None:
    """Write the frames R (n, 3, 3), o (n, 3) [m] of the bodies at angles q (n,), and S (n, 6).

    S is the motion that each joint adds at unit rate; tree is a `Geometry`.
    """
    for i in range(len(q)):
        p = tree.parent[i]
        x, y, z = tree.axis[i, 0], tree.axis[i, 1], tree.axis[i, 2]
        s, c = (0.0, 1.0) if tree.prismatic[i] else (np.sin(q[i]), np.cos(q[i]))
        t = 1.0 - c
        for r in range(3):
            a, b, d = tree.turn[i, r, 0], tree.turn[i, r, 1], tree.turn[i, r, 2]
            along = t * (a * x + b * y + d * z)
            o[i, r] = tree.shift[i, r]
            R[i, r, 0] = along * x + c * a + s * (b * z - d * y)
            R[i, r, 1] = along * y + c * b + s * (d * x - a * z)
            R[i, r, 2] = along * z + c * d + s * (a * y - b * x)
        if p >= 0:
            for col in range(3):
                u0, u1, u2 = R[i, 0, col], R[i, 1, col], R[i, 2, col]
                for r in range(3):
                    R[i, r, col] = R[p, r, 0] * u0 + R[p, r, 1] * u1 + R[p, r, 2] * u2
            u0, u1, u2 = o[i, 0], o[i, 1], o[i, 2]
            for r in range(3):
                o[i, r] = o[p, r] + R[p, r, 0] * u0 + R[p, r, 1] * u1 + R[p, r, 2] * u2
        z0 = R[i, 0, 0] * x + R[i, 0, 1] * y + R[i, 0, 2] * z
        z1 = R[i, 1, 0] * x + R[i, 1, 1] * y + R[i, 1, 2] * z
        z2 = R[i, 2, 0] * x + R[i, 2, 1] * y + R[i, 2, 2] * z
        if tree.prismatic[i]:
            o[i, 0] += z0 * q[i]
            o[i, 1] += z1 * q[i]
            o[i, 2] += z2 * q[i]
            S[i, 0], S[i, 1], S[i, 2] = 0.0, 0.0, 0.0
            S[i, 3], S[i, 4], S[i, 5] = z0, z1, z2
        else:
            S[i, 0], S[i, 1], S[i, 2] = z0, z1, z2
            S[i, 3] = o[i, 1] * z2 - o[i, 2] * z1
            S[i, 4] = o[i, 2] * z0 - o[i, 0] * z2
            S[i, 5] = o[i, 0] * z1 - o[i, 1] * z0


def frames(tree: Any, q: Array) -> tuple[Array, Array]:
    """Frames (K, n, 3, 3) and origins (K, n, 3) of the bodies at positions (K, n)."""
    K, n = q.shape
    R, o, S = np.empty((K, n, 3, 3)), np.empty((K, n, 3)), np.empty((n, 6))
    for k in range(K):
        placements.py_func(tree, q[k], R[k], o[k], S)
    return R, o


@inlined
def motion(tree: Any, base: Any, S: Any, w: Any, rate: Any, v: Any, dS: Any, a: Any) -> None:
    """Write velocities v, changes dS of the joint motions and accelerations a, (n, 6) each.

    Accelerations are less gravity, at joint velocities w and dw/dt = rate. With the parent p of i,

        v_i = v_p + S_i w_i,    dS_i = v_p x S_i,    a_i = a_p + S_i dw_i/dt + dS_i w_i.

    base (9,) : angular velocity, angular and proper acceleration of the base. Its velocity does not
    count: velocities are those against an observer who goes along without turning.
    """
    still = (base[0], base[1], base[2], 0.0, 0.0, 0.0)
    for i in range(len(w)):
        p = tree.parent[i]
        d = cross_motion(still, S[i]) if p < 0 else cross_motion(v[p], S[i])
        for c in range(6):
            dS[i, c] = d[c]
            v[i, c] = (still[c] if p < 0 else v[p, c]) + S[i, c] * w[i]
            a[i, c] = (base[3 + c] if p < 0 else a[p, c]) + S[i, c] * rate[i] + d[c] * w[i]


@inlined
def world_inertias(pi: Any, R: Any, o: Any, out: Any) -> None:
    """Write inertial parameters (n, 10) about the origin of the base, see `spatial`.

    pi : ten of each body (10 n,) about the origin of its own frame
    R, o : frames of the bodies, see `kinematics.placements`
    """
    for i in range(len(o)):
        k = 10 * i
        m, h0, h1, h2 = pi[k], pi[k + 1], pi[k + 2], pi[k + 3]
        a, b, c, d, e, f = pi[k + 4], pi[k + 5], pi[k + 6], pi[k + 7], pi[k + 8], pi[k + 9]
        r = R[i]
        x, y, z = o[i, 0], o[i, 1], o[i, 2]
        u0 = r[0, 0] * h0 + r[0, 1] * h1 + r[0, 2] * h2
        u1 = r[1, 0] * h0 + r[1, 1] * h1 + r[1, 2] * h2
        u2 = r[2, 0] * h0 + r[2, 1] * h1 + r[2, 2] * h2
        out[i, 0] = m
        out[i, 1], out[i, 2], out[i, 3] = u0 + m * x, u1 + m * y, u2 + m * z
        # (o + r)(o + r)' summed over the body, beyond r r'
        xx = x * (2.0 * u0 + m * x)
        yy = y * (2.0 * u1 + m * y)
        zz = z * (2.0 * u2 + m * z)
        out[i, 5] = -(x * u1 + y * u0 + m * x * y)
        out[i, 6] = -(x * u2 + z * u0 + m * x * z)
        out[i, 8] = -(y * u2 + z * u1 + m * y * z)
        out[i, 4], out[i, 7], out[i, 9] = yy + zz, xx + zz, xx + yy
        for s in range(3):
            p0 = r[s, 0] * a + r[s, 1] * b + r[s, 2] * c
            p1 = r[s, 0] * b + r[s, 1] * d + r[s, 2] * e
            p2 = r[s, 0] * c + r[s, 1] * e + r[s, 2] * f
            for t in range(s, 3):
                at = 4 + t if s == 0 else 5 + s + t
                out[i, at] += p0 * r[t, 0] + p1 * r[t, 1] + p2 * r[t, 2]


@inlined
def add_to_parents(parent: Any, values: Any, count: int) -> None:
    """Sum what each body has (n, c) over all bodies that its joint carries, in place."""
    # the count is a constant where this is inlined
    for i in range(len(parent) - 1, -1, -1):
        p = parent[i]
        if p >= 0:
            for c in range(count):
                values[p, c] += values[i, c]
