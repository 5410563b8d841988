"""Recursive Newton-Euler algorithm: torques of a motion, and its momentum [Featherstone2008]."""

from __future__ import annotations

from typing import Any

from frictionid.mechanics.rigid_body.inertia import add_to_parents
from frictionid.mechanics.rigid_body.spatial import cross_force, dot, momentum
from frictionid.programs.loops import inlined


@inlined
def torques(parent: Any, S: Any, v: Any, a: Any, inertia: Any, force: Any, out: Any) -> None:
    """Write the torques (n,) of a motion without those of the rotors, and the forces (n, 6).

    The torque of joint i is S_i' of the forces I a + v x* I v of all bodies that it carries.

    v, a, inertia : velocities, accelerations less gravity and inertias of the bodies
    """
    for i in range(len(parent)):
        inert = momentum(inertia[i], a[i])
        carried = cross_force(v[i], momentum(inertia[i], v[i]))
        for c in range(6):
            force[i, c] = inert[c] + carried[c]
    add_to_parents(parent, force, 6)
    for i in range(len(parent)):
        out[i] = dot(S[i], force[i])


@inlined
def lagrangian_slopes(
    tree: Any, S: Any, v: Any, dS: Any, inertia: Any, carried: Any, moving: Any, out: Any
) -> float:
    """Write dL/dq (n,) without that of the rotors; the potential energy [J], zero in the origin.

    Where joint i moves all that it carries, momentum and all, its kinetic energy stays; so dT/dq_i
    is the momentum's product with v_p x S_i, and -dV/dq_i the power of gravity on S_i.

    carried : inertia of all that each joint carries; moving (n, 6) : scratch, for their momenta
    """
    g0, g1, g2 = tree.gravity[0], tree.gravity[1], tree.gravity[2]
    energy = 0.0
    for i in range(len(out)):
        own = momentum(inertia[i], v[i])
        for c in range(6):
            moving[i, c] = own[c]
        energy -= inertia[i, 1] * g0 + inertia[i, 2] * g1 + inertia[i, 3] * g2
    add_to_parents(tree.parent, moving, 6)
    for i in range(len(out)):
        m, h0, h1, h2 = carried[i, 0], carried[i, 1], carried[i, 2], carried[i, 3]
        weight = (h1 * g2 - h2 * g1, h2 * g0 - h0 * g2, h0 * g1 - h1 * g0, m * g0, m * g1, m * g2)
        out[i] = dot(dS[i], moving[i]) + dot(S[i], weight)
    return energy
