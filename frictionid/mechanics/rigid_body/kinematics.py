"""Where the joints of a tree are and how they move, for many samples at once.

Everything is in the frame of the base, so that no later algorithm knows frames. S_i is the motion
that joint i adds at unit rate. With the parent p of i,

    v_i = v_p + S_i w_i,    a_i = a_p + S_i dw_i/dt + v_p x S_i w_i,    a of the base = -gravity.
"""

from __future__ import annotations

import math

import numpy as np

from frictionid.arrays import Array
from frictionid.compiled import compiled
from frictionid.mechanics.rigid_body.spatial import cross_motion


@compiled
def placements(
    parent: Array, prismatic: Array, axis: Array, turn: Array, shift: Array, q: Array
) -> tuple[Array, Array, Array]:
    """Frames of the bodies and joint motions at angles q (K, n).

    Parameters
    ----------
    parent : array of int, shape (n,), -1 is the base; a parent stands before its children
    prismatic : array of bool, shape (n,)
    axis : array, shape (n, 3), unit vector in the frame of the joint
    turn, shift : arrays, shapes (n, 3, 3) and (n, 3) [m], frame of the joint in its parent's

    Returns
    -------
    R (K, n, 3, 3), o (K, n, 3) [m], S (K, n, 6)
    """
    K, n = q.shape
    R, o, S = np.empty((K, n, 3, 3)), np.empty((K, n, 3)), np.empty((K, n, 6))
    joint = np.empty((3, 3))
    for k in range(K):
        for i in range(n):
            p, x, y, z = parent[i], axis[i, 0], axis[i, 1], axis[i, 2]
            if prismatic[i]:
                joint[:] = turn[i]
            else:
                s, c = math.sin(q[k, i]), math.cos(q[k, i])
                t = 1.0 - c
                for r in range(3):
                    a, b, d = turn[i, r, 0], turn[i, r, 1], turn[i, r, 2]
                    along = t * (a * x + b * y + d * z)
                    joint[r, 0] = along * x + c * a + s * (b * z - d * y)
                    joint[r, 1] = along * y + c * b + s * (d * x - a * z)
                    joint[r, 2] = along * z + c * d + s * (a * y - b * x)
            for r in range(3):
                if p < 0:
                    R[k, i, r] = joint[r]
                    o[k, i, r] = shift[i, r]
                else:
                    for col in range(3):
                        R[k, i, r, col] = (
                            R[k, p, r, 0] * joint[0, col]
                            + R[k, p, r, 1] * joint[1, col]
                            + R[k, p, r, 2] * joint[2, col]
                        )
                    o[k, i, r] = (
                        o[k, p, r]
                        + R[k, p, r, 0] * shift[i, 0]
                        + R[k, p, r, 1] * shift[i, 1]
                        + R[k, p, r, 2] * shift[i, 2]
                    )
            z0, z1, z2 = (
                R[k, i, 0, 0] * x + R[k, i, 0, 1] * y + R[k, i, 0, 2] * z,
                R[k, i, 1, 0] * x + R[k, i, 1, 1] * y + R[k, i, 1, 2] * z,
                R[k, i, 2, 0] * x + R[k, i, 2, 1] * y + R[k, i, 2, 2] * z,
            )
            if prismatic[i]:
                o[k, i, 0] += z0 * q[k, i]
                o[k, i, 1] += z1 * q[k, i]
                o[k, i, 2] += z2 * q[k, i]
                S[k, i, :3] = 0.0
                S[k, i, 3], S[k, i, 4], S[k, i, 5] = z0, z1, z2
            else:
                x0, x1, x2 = o[k, i]
                S[k, i, 0], S[k, i, 1], S[k, i, 2] = z0, z1, z2
                S[k, i, 3] = x1 * z2 - x2 * z1
                S[k, i, 4] = x2 * z0 - x0 * z2
                S[k, i, 5] = x0 * z1 - x1 * z0
    return R, o, S


@compiled
def velocities(parent: Array, S: Array, w: Array) -> tuple[Array, Array]:
    """Velocities v (K, n, 6) of the bodies, and v_p x S (K, n, 6), how joint motions change."""
    K, n = w.shape
    v, dS = np.empty((K, n, 6)), np.empty((K, n, 6))
    for k in range(K):
        for i in range(n):
            p = parent[i]
            if p < 0:
                dS[k, i] = 0.0
                for c in range(6):
                    v[k, i, c] = S[k, i, c] * w[k, i]
            else:
                cross_motion(v[k, p], S[k, i], dS[k, i])
                for c in range(6):
                    v[k, i, c] = v[k, p, c] + S[k, i, c] * w[k, i]
    return v, dS


@compiled
def accelerations(
    parent: Array, gravity: Array, S: Array, dS: Array, w: Array, rate: Array
) -> Array:
    """Accelerations (K, n, 6) of the bodies less gravity (3,), at joint rates dw/dt (K, n)."""
    K, n = w.shape
    a = np.empty((K, n, 6))
    for k in range(K):
        for i in range(n):
            p = parent[i]
            for c in range(6):
                own = S[k, i, c] * rate[k, i] + dS[k, i, c] * w[k, i]
                if p >= 0:
                    a[k, i, c] = a[k, p, c] + own
                elif c < 3:
                    a[k, i, c] = own
                else:
                    a[k, i, c] = own - gravity[c - 3]
    return a
