"""Where the joints of a tree are.

Everything is in the frame of the base, so that no later algorithm knows frames.
"""

from __future__ import annotations

import math
from typing import Any

from frictionid.mechanics.rigid_body.spatial import cross_motion
from frictionid.programs.loops import inlined


@inlined
def placements(tree: Any, q: Any, R: Any, o: Any, S: Any) -> None:
    """Write the frames R (n, 3, 3), o (n, 3) [m] of the bodies at angles q (n,), and S (n, 6).

    S is the motion that each joint adds at unit rate; tree is a `Geometry`.
    """
    for i in range(len(q)):
        p = tree.parent[i]
        x, y, z = tree.axis[i, 0], tree.axis[i, 1], tree.axis[i, 2]
        s, c = (0.0, 1.0) if tree.prismatic[i] else (math.sin(q[i]), math.cos(q[i]))
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


@inlined
def motion(tree: Any, S: Any, w: Any, rate: Any, v: Any, dS: Any, a: Any) -> None:
    """Write velocities v, changes dS of the joint motions and accelerations a, (n, 6) each.

    Accelerations are less gravity, at joint velocities w and dw/dt = rate. With the parent p of i,

        v_i = v_p + S_i w_i,    dS_i = v_p x S_i,    a_i = a_p + S_i dw_i/dt + dS_i w_i.
    """
    for i in range(len(w)):
        p = tree.parent[i]
        if p < 0:
            for c in range(6):
                dS[i, c] = 0.0
                v[i, c] = S[i, c] * w[i]
                a[i, c] = S[i, c] * rate[i]
            for c in range(3):
                a[i, 3 + c] -= tree.gravity[c]
        else:
            d = cross_motion(v[p], S[i])
            for c in range(6):
                dS[i, c] = d[c]
                v[i, c] = v[p, c] + S[i, c] * w[i]
                a[i, c] = a[p, c] + S[i, c] * rate[i] + d[c] * w[i]
