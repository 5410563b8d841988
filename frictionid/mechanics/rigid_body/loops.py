"""Loops over samples: the algorithms of this folder at K states, compiled.

Base parameters p have shape (1, nb) or (K, nb), with the motion of the base behind them where it
moves (nb + 9); results are written to the arrays that come last.
"""

from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.loops import compiled, inlined

from .kinematics import add_to_parents, dot, momentum, motion, placements, world_inertias
from .rnea import (
    add_mass_matrix,
    lagrangian_slopes,
    prepare,
    torque_derivatives,
    torque_regressor,
    torques,
)


class Geometry(NamedTuple):
    """Arrays of a `Tree` that the algorithms read, and which parameters the base parameters lead.

    silent (N,) times base parameter `carrier` adds to the leading ones, see `BaseParameters`.
    """

    parent: Array
    prismatic: Array
    axis: Array
    turn: Array
    shift: Array
    gravity: Array
    rotors: Array
    leading: Array
    silent: Array
    carrier: int


@inlined
def _expand(tree: Any, p: Any, pi: Any, rotor: Any, base: Any) -> None:
    """Write inertial parameters (N,), the rotors' share in M (n, n), the base's motion (9,)."""
    n, count = len(tree.parent), len(tree.leading)
    for c in range(9):
        at_rest = -tree.gravity[c - 6] if c >= 6 else 0.0
        base[c] = p[count + c] if len(p) > count else at_rest
    for k in range(len(pi)):
        pi[k] = p[tree.carrier] * tree.silent[k]
    for k in range(count):
        pi[tree.leading[k]] += p[k]
    rotor[:] = 0.0
    for r in range(len(tree.rotors)):
        for i in range(n):
            if tree.rotors[r, i] != 0.0:
                for j in range(n):
                    rotor[i, j] += pi[10 * n + r] * tree.rotors[r, i] * tree.rotors[r, j]


@inlined
def _scratch(tree: Any) -> Any:
    """Arrays for base, pi, rotors, R, o, S, inertia, v, dS, a, force of one sample."""
    n, base, pi = len(tree.parent), np.empty(9), np.empty(len(tree.silent))
    rotor, R, o = np.empty((n, n)), np.empty((n, 3, 3)), np.empty((n, 3))
    S, bodies, v = np.empty((n, 6)), np.empty((n, 10)), np.empty((n, 6))
    dS, a, force = np.empty((n, 6)), np.empty((n, 6)), np.empty((n, 6))
    return base, pi, rotor, R, o, S, bodies, v, dS, a, force


@inlined
def _copy(source: Any, target: Any) -> None:
    """Set a matrix; as a slice that takes a second to compile, for the words of its error."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def inertia(tree: Geometry, p: Array, q: Array, M: Array) -> None:
    """Mass matrices M (K, n, n)."""
    base, pi, rotor, R, o, S, bodies, _, _, _, _ = _scratch(tree)
    for k in range(len(q)):
        if k == 0 or len(p) > 1:
            _expand(tree, p[k], pi, rotor, base)
        placements(tree, q[k], R, o, S)
        world_inertias(pi, R, o, bodies)
        add_to_parents(tree.parent, bodies, 10)
        _copy(rotor, M[k])
        add_mass_matrix(tree.parent, S, bodies, M[k])


@compiled
def dynamics(tree: Geometry, p: Array, q: Array, w: Array, M: Array, h: Array) -> None:
    """Mass matrices M (K, n, n) and h (K, n)."""
    base, pi, rotor, R, o, S, bodies, v, dS, a, force = _scratch(tree)
    rate = np.zeros(q.shape[1])
    for k in range(len(q)):
        if k == 0 or len(p) > 1:
            _expand(tree, p[k], pi, rotor, base)
        placements(tree, q[k], R, o, S)
        world_inertias(pi, R, o, bodies)
        motion(tree, base, S, w[k], rate, v, dS, a)
        torques(tree.parent, S, v, a, bodies, force, h[k])
        for i in range(len(rate)):
            h[k, i] = -h[k, i]
        add_to_parents(tree.parent, bodies, 10)
        _copy(rotor, M[k])
        add_mass_matrix(tree.parent, S, bodies, M[k])


@compiled
def lagrangian(
    tree: Geometry, p: Array, q: Array, w: Array, slope: Array, energy: Array, turned: Array
) -> None:
    """dL/dq (K, n), potential energies (K,) [J], momenta (K, n) as the base turns them all."""
    base, pi, rotor, R, o, S, bodies, v, dS, a, moving = _scratch(tree)
    carried = np.empty_like(bodies)
    for k in range(len(q)):
        if k == 0 or len(p) > 1:
            _expand(tree, p[k], pi, rotor, base)
        placements(tree, q[k], R, o, S)
        world_inertias(pi, R, o, bodies)
        motion(tree, base, S, w[k], w[k], v, dS, a)
        _copy(bodies, carried)
        add_to_parents(tree.parent, carried, 10)
        for i in range(len(o)):
            still = (base[0], base[1], base[2], 0.0, 0.0, 0.0)
            turned[k, i] = dot(S[i], momentum(carried[i], still))
        energy[k] = lagrangian_slopes(tree, base, S, v, dS, bodies, carried, moving, slope[k])


@compiled
def derivatives(
    tree: Geometry, p: Array, q: Array, w: Array, rate: Array, by_q: Array, by_w: Array
) -> None:
    """Derivatives of M dw/dt - h by q and w (K, n, n)."""
    base, pi, rotor, R, o, S, bodies, v, dS, a, force = _scratch(tree)
    B, twice, out = np.empty((len(o), 12)), np.empty_like(S), np.empty(len(o))
    for k in range(len(q)):
        if k == 0 or len(p) > 1:
            _expand(tree, p[k], pi, rotor, base)
        placements(tree, q[k], R, o, S)
        world_inertias(pi, R, o, bodies)
        motion(tree, base, S, w[k], rate[k], v, dS, a)
        torques(tree.parent, S, v, a, bodies, force, out)
        prepare(tree, base, S, v, dS, a, bodies, B, twice)
        add_to_parents(tree.parent, bodies, 10)
        torque_derivatives(tree.parent, S, dS, twice, bodies, B, force, by_q[k], by_w[k])


@compiled
def regressor(
    tree: Geometry, bases: Array, columns: Array, q: Array, w: Array, rate: Array, Y: Array
) -> None:
    """Torques (K, n, C) of motions with one unit parameter each, of the 10 n of all bodies.

    bases : motions of the base, shape (1, 9) or (K, 9)
    """
    _, _, _, R, o, S, _, v, dS, a, _ = _scratch(tree)
    wrench = np.empty((10, 6))
    for k in range(len(q)):
        placements(tree, q[k], R, o, S)
        base = bases[k] if len(bases) > 1 else bases[0]
        motion(tree, base, S, w[k], rate[k], v, dS, a)
        torque_regressor(tree.parent, (R, o), S, v, a, columns, wrench, Y[k])
