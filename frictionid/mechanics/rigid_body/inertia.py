"""Inertial parameters of the bodies in the frame of the base."""

from __future__ import annotations

from typing import Any

from frictionid.programs.loops import inlined


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
