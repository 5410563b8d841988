"""Composite-rigid-body algorithm: the mass matrix of a tree [Featherstone2008]."""

from __future__ import annotations

from typing import Any

from frictionid.mechanics.rigid_body.spatial import dot, momentum
from frictionid.programs.loops import inlined


@inlined
def add_mass_matrix(parent: Any, S: Any, carried: Any, M: Any) -> None:
    """Add S_j' I_i S_i to M_ji and M_ij (n, n) for every joint j that carries joint i.

    carried : array, shape (n, 10), inertia I_i of all that joint i carries
    """
    for i in range(len(parent)):
        force = momentum(carried[i], S[i])
        M[i, i] += dot(S[i], force)
        j = parent[i]
        while j >= 0:
            value = dot(S[j], force)
            M[j, i] += value
            M[i, j] += value
            j = parent[j]
