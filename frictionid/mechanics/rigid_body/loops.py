"""Loops over samples: the algorithms of this folder at K states, compiled.

Base parameters p have shape (1, nb) or (K, nb), with the motion of the base behind them where it
moves (nb + 9); results are written to the arrays that come last.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.programs.machine_code import compiled, inlined
from frictionid.programs.trace import Traced, traced_loop

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
def _base_motion(tree: Any, p: Any, base: Any) -> None:
    """Write the base's motion (9,), which stands behind base parameters p where it moves."""
    count = len(tree.leading)
    for c in range(9):
        at_rest = -tree.gravity[c - 6] if c >= 6 else 0.0
        base[c] = p[count + c] if len(p) > count else at_rest


@inlined
def _expand(tree: Any, p: Any, pi: Any, rotor: Any, base: Any) -> None:
    """Write inertial parameters (N,), the rotors' share in M (n, n), the base's motion (9,)."""
    n, count = len(tree.parent), len(tree.leading)
    _base_motion(tree, p, base)
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
def _scratch(tree: Any, kind: Any) -> Any:
    """Arrays of a type for base, pi, rotors, R, o, S, inertia, v, dS, a, force of one sample."""
    n, base, pi = len(tree.parent), np.empty(9, kind), np.empty(len(tree.silent), kind)
    rotor, R, o = np.empty((n, n), kind), np.empty((n, 3, 3), kind), np.empty((n, 3), kind)
    S, bodies, v = np.empty((n, 6), kind), np.empty((n, 10), kind), np.empty((n, 6), kind)
    dS, a, force = np.empty((n, 6), kind), np.empty((n, 6), kind), np.empty((n, 6), kind)
    return base, pi, rotor, R, o, S, bodies, v, dS, a, force


@inlined
def _place(tree: Any, k: int, p: Any, q: Any, room: Any) -> None:
    """Write base, pi, rotors, R, o, S and inertia of sample k; parameters may be those of all."""
    base, pi, rotor, R, o, S, bodies, _, _, _, _ = room
    if k == 0 or len(p) > 1:
        _expand(tree, p[k], pi, rotor, base)
    placements(tree, q[k], R, o, S)
    world_inertias(pi, R, o, bodies)


@inlined
def _copy(source: Any, target: Any) -> None:
    """Set a matrix; as a slice that takes a second to compile, for the words of its error."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def inertia(tree: Geometry, p: Array, q: Array, M: Array) -> None:
    """Mass matrices M (K, n, n)."""
    room = _scratch(tree, q.dtype)
    _, _, rotor, _, _, S, bodies, _, _, _, _ = room
    for k in range(len(q)):
        _place(tree, k, p, q, room)
        add_to_parents(tree.parent, bodies, 10)
        _copy(rotor, M[k])
        add_mass_matrix(tree.parent, S, bodies, M[k])


@compiled
def dynamics(tree: Geometry, p: Array, q: Array, w: Array, M: Array, h: Array) -> None:
    """Mass matrices M (K, n, n) and h (K, n)."""
    room = _scratch(tree, q.dtype)
    base, _, rotor, _, o, S, bodies, v, dS, a, force = room
    rate = np.zeros(q.shape[1])
    for k in range(len(q)):
        _place(tree, k, p, q, room)
        motion(tree, base, S, w[k], rate, v, dS, a)
        torques(tree.parent, S, v, a, bodies, force, h[k])
        for i in range(len(rate)):
            h[k, i] = -h[k, i]
        add_to_parents(tree.parent, bodies, 10)
        _copy(rotor, M[k])
        add_mass_matrix(tree.parent, S, bodies, M[k])


@compiled
def terms(
    tree: Geometry,
    p: Array,
    q: Array,
    w: Array,
    M: Array,
    h: Array,
    slope: Array,
    energy: Array,
    turned: Array,
) -> None:
    """What `dynamics` writes, dL/dq (K, n), and potential energies (K,) [J].

    turned (K, n) : momenta as the base turns them all
    """
    room = _scratch(tree, q.dtype)
    base, _, rotor, _, o, S, bodies, v, dS, a, force = room
    carried, rate = np.empty_like(bodies), np.zeros(q.shape[1])
    for k in range(len(q)):
        _place(tree, k, p, q, room)
        motion(tree, base, S, w[k], rate, v, dS, a)
        torques(tree.parent, S, v, a, bodies, force, h[k])
        _copy(bodies, carried)
        add_to_parents(tree.parent, carried, 10)
        for i in range(len(o)):
            h[k, i] = -h[k, i]
            still = (base[0], base[1], base[2], 0.0, 0.0, 0.0)
            turned[k, i] = dot(S[i], momentum(carried[i], still))
        energy[k] = lagrangian_slopes(tree, base, S, v, dS, bodies, carried, force, slope[k])
        _copy(rotor, M[k])
        add_mass_matrix(tree.parent, S, carried, M[k])


@compiled
def derivatives(
    tree: Geometry, p: Array, q: Array, w: Array, rate: Array, by_q: Array, by_w: Array
) -> None:
    """Derivatives of M dw/dt - h by q and w (K, n, n)."""
    room = _scratch(tree, q.dtype)
    base, _, rotor, _, o, S, bodies, v, dS, a, force = room
    B, twice, out = np.empty((len(o), 12), q.dtype), np.empty_like(S), np.empty_like(q[0])
    for k in range(len(q)):
        _place(tree, k, p, q, room)
        motion(tree, base, S, w[k], rate[k], v, dS, a)
        torques(tree.parent, S, v, a, bodies, force, out)
        prepare(tree, base, S, v, dS, a, bodies, B, twice)
        add_to_parents(tree.parent, bodies, 10)
        torque_derivatives(tree.parent, S, dS, twice, bodies, B, force, by_q[k], by_w[k])


@compiled
def regressor(tree: Geometry, p: Array, q: Array, w: Array, rate: Array, Y: Array) -> None:
    """Torques (K, n, nb) of motions by one unit of each leading parameter, the others zero."""
    base, _, _, R, o, S, _, v, dS, a, _ = _scratch(tree, q.dtype)
    wrench, n = np.empty((10, 6), q.dtype), len(tree.parent)
    bodies = tree.leading[tree.leading < 10 * n]
    for k in range(len(q)):
        if k == 0 or len(p) > 1:
            _base_motion(tree, p[k], base)
        placements(tree, q[k], R, o, S)
        motion(tree, base, S, w[k], rate[k], v, dS, a)
        torque_regressor(tree.parent, (R, o), S, v, a, bodies, wrench, Y[k])
        for c in range(len(bodies), len(tree.leading)):
            turns, speed = tree.rotors[tree.leading[c] - 10 * n], 0.0 * rate[k, 0]
            for i in range(n):
                speed += turns[i] * rate[k, i]
            for i in range(n):
                Y[k, i, c] = turns[i] * speed


def evaluate(
    loop: Callable[..., object],
    tree: Geometry,
    shapes: tuple[tuple[int, ...], ...],
    p: Array,
    *states: Array,
) -> list[Array]:
    """Arrays (..., *shape) that a loop fills, of p and states whose batch axes broadcast."""
    if any(isinstance(x, Traced) for x in (p, *states)):
        return traced_loop(loop, tree, shapes, p, *states)
    lead = np.broadcast_shapes(*(np.shape(x)[:-1] for x in (p, *states)))
    p = _flat(p, (1,) if math.prod(np.shape(p)[:-1]) == 1 else lead)
    out = [np.empty((math.prod(lead), *shape)) for shape in shapes]
    loop(tree, p, *(_flat(x, lead) for x in states), *out)
    return [x.reshape((*lead, *x.shape[1:])) for x in out]


def _flat(x: Array, lead: tuple[int, ...]) -> Array:
    """Rows (K, n) of an array whose batch axes broadcast to `lead`, of the kind loops are for."""
    x = np.asarray(x, dtype=float)
    if x.shape[:-1] != lead and x.size > x.shape[-1]:
        x = np.broadcast_to(x, (*lead, x.shape[-1]))
    x = np.require(x.reshape(-1, x.shape[-1]), requirements=["C", "W"])
    rows = math.prod(lead)
    return x if len(x) == rows else np.ascontiguousarray(np.broadcast_to(x, (rows, x.shape[-1])))
