"""Composite-rigid-body algorithm: the mass matrix of a tree [Featherstone2008]."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.compiled import compiled
from frictionid.mechanics.rigid_body.spatial import dot, momentum


@compiled
def mass_matrix(parent: Array, S: Array, carried: Array) -> Array:
    """M (K, n, n) without rotors: M_ji = S_j' I_i S_i for every j that carries i.

    carried : array, shape (K, n, 10), inertia of all that each joint carries
    """
    K, n = S.shape[0], S.shape[1]
    M, force = np.zeros((K, n, n)), np.empty(6)
    for k in range(K):
        for i in range(n):
            momentum(carried[k, i], S[k, i], force)
            j = i
            while j >= 0:
                M[k, j, i] = dot(S[k, j], force)
                M[k, i, j] = M[k, j, i]
                j = parent[j]
    return M
