"""Recursive Newton-Euler algorithm: torques of a motion, and its momentum [Featherstone2008]."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.compiled import compiled
from frictionid.mechanics.rigid_body.spatial import body_force, dot, momentum


@compiled
def torques(parent: Array, S: Array, v: Array, a: Array, inertia: Array) -> Array:
    """Torques (K, n) of a motion, without those of the rotors: S_i' of all forces beyond joint i.

    v, a, inertia : velocities, accelerations less gravity and inertias of the bodies
    """
    K, n = S.shape[0], S.shape[1]
    out, force, scratch = np.empty((K, n)), np.empty((n, 6)), np.empty(6)
    for k in range(K):
        for i in range(n):
            body_force(inertia[k, i], v[k, i], a[k, i], scratch, force[i])
        for i in range(n - 1, -1, -1):
            out[k, i] = dot(S[k, i], force[i])
            if parent[i] >= 0:
                for c in range(6):
                    force[parent[i], c] += force[i, c]
    return out


@compiled
def slopes_of_lagrangian(
    parent: Array, gravity: Array, S: Array, v: Array, dS: Array, inertia: Array, carried: Array
) -> tuple[Array, Array]:
    """dL/dq (K, n) and the potential energy (K,) [J], zero in the origin of the base.

    Where joint i moves all that it carries, momentum and all, its kinetic energy stays; so dT/dq_i
    is the momentum's product with v_p x S_i, and -dV/dq_i the power of gravity on S_i.
    """
    K, n = S.shape[0], S.shape[1]
    slope, energy = np.empty((K, n)), np.zeros(K)
    moving, weight = np.empty((n, 6)), np.empty(6)
    g0, g1, g2 = gravity
    for k in range(K):
        for i in range(n):
            momentum(inertia[k, i], v[k, i], moving[i])
            energy[k] -= inertia[k, i, 1] * g0 + inertia[k, i, 2] * g1 + inertia[k, i, 3] * g2
        for i in range(n - 1, -1, -1):
            m, h0, h1, h2 = carried[k, i, :4]
            weight[0], weight[1], weight[2] = (
                h1 * g2 - h2 * g1,
                h2 * g0 - h0 * g2,
                h0 * g1 - h1 * g0,
            )
            weight[3], weight[4], weight[5] = m * g0, m * g1, m * g2
            slope[k, i] = dot(dS[k, i], moving[i]) + dot(S[k, i], weight)
            if parent[i] >= 0:
                for c in range(6):
                    moving[parent[i], c] += moving[i, c]
    return slope, energy
