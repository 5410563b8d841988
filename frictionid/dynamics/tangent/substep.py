"""The variational equation: how the derivatives of a motion advance over one substep.

    M da + d(M a - h - B u + A' Tf)/d(q, w, ...) = 0,    dq' = dw,    dw' = da

linearised in the middle of the substep and integrated by the implicit midpoint rule in w: second
order, and stable however steep friction is. A held part's velocity A w has no derivatives.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, solve
from frictionid.dynamics.sliding_friction import Stiction, braked
from frictionid.dynamics.state import State, driven, inputs
from frictionid.dynamics.tangent.law_derivatives import SPEED, Slopes, by_memory, by_theta, slopes
from frictionid.dynamics.tangent.tangent import MotionModel, Tangent, inverse_of_free, rows_of_parts
from frictionid.dynamics.torque_balance import constrained
from frictionid.dynamics.zero_crossing import Crossing
from frictionid.friction import Memory
from frictionid.friction.coordinates import of_parts, onto_joints
from frictionid.mechanics import Partials

_GRAZE = 0.1  # of a slow speed


def cross_tangent(
    tangent: Tangent, start: list[Array], w0: Array, crossing: Crossing, h: Array, slow: Array
) -> None:
    """Change the derivatives of the rows that cross w = 0 in a substep, in place.

    A joint that stops keeps the derivative of its angle and hands its momentum on. Of a joint that
    passes, friction switches its side earlier or later: dw changes by kick dt, where t = h w1/(w1 -
    w0) is the time since the crossing.

    start : derivatives of w before the substep; w0 : (k, n) velocities before it; h : (k,) length
    slow : (m,) speeds of parts near rest
    """
    n, rows, turns = len(tangent.q), crossing.rows, crossing.turns
    w0, w1 = of_parts(w0, turns), of_parts(crossing.w, turns)
    angle, end = [q[:, rows] for q in tangent.q], [w[:, rows] for w in tangent.w]
    for j in range(n):
        angle[j] -= np.where(crossing.stops[:, j], h / 2, 0.0) * end[j]
    if crossing.passes.any():
        later = np.zeros_like(end[0])
        before, after = rows_of_parts(start, turns), rows_of_parts(end, turns)
        for j in range(w1.shape[-1]):
            # minus the derivative of the time since the crossing; bounded where w = 0 is just met
            gap = np.maximum((w0[:, j] - w1[:, j]) ** 2, (_GRAZE * slow[j]) ** 2)
            part = np.where(crossing.passes[:, j], h / gap, 0.0)
            later += part * (w0[:, j] * after[j] - w1[:, j] * before[j])
        for i in range(n):
            end[i] = end[i] - crossing.jump[:, i] * later
    if crossing.stops.any():
        free = inverse_of_free(crossing.M, crossing.sticking, turns)
        kept = (free[..., None] * crossing.M[:, None]).sum(-2)
        some = np.asarray(crossing.stops.any(-1))
        kept = np.where(some[:, None, None], kept, np.eye(n))
        end = [np.asarray(sum(kept[:, i, j] * end[j] for j in range(n))) for i in range(n)]
    for i in range(n):
        tangent.q[i][:, rows], tangent.w[i][:, rows] = angle[i], end[i]


class MemoryRates(NamedTuple):
    """Derivatives of the memory after some time, by the memory, velocity and theta before it.

    by_memory : of each entry (K, n) by each entry; by_w : (K, n); by_theta : (m, K), of each entry
    """

    by_memory: tuple[Memory, ...]
    by_w: Memory
    by_theta: tuple[Array, ...]


def memory_rates(model: MotionModel, state: State, u: Array, dt: Array) -> MemoryRates:
    """Those over dt at a state; none for laws that advance with the samples."""
    law, theta = model.friction.law, model.friction.theta
    if not state.memory or law.sample_time is not None:
        return MemoryRates((), (), ())
    x = inputs(model.plant, model.friction, state, u)
    up, down = (
        law.advance(theta, x._replace(w=x.w + s * SPEED), state.memory, dt) for s in (1.0, -1.0)
    )
    by_w = tuple((a - b) / (2 * SPEED) for a, b in zip(up, down, strict=True))

    def one(i: int) -> tuple[Memory, Array]:
        def of_memory(memory: Memory) -> Array:
            return law.advance(theta, x, memory, dt)[i]

        def of_theta(theta: Array) -> Array:
            return law.advance(theta, x, state.memory, dt)[i]

        own = by_theta(theta, model.free, of_theta, None, 0.0 * x.w)
        return by_memory(of_memory, state.memory), own

    inner, own = zip(*(one(i) for i in range(len(state.memory))), strict=True)
    return MemoryRates(inner, by_w, own)


def advance_memory(model: MotionModel, tangent: Tangent, rates: MemoryRates) -> None:
    """Advance the derivatives of the memory, in place, over the time of the rates."""
    new, moves = [], rows_of_parts(tangent.w, model.turns)
    for inner, by_w, own in zip(rates.by_memory, rates.by_w, rates.by_theta, strict=True):
        rows = []
        for j, dw in enumerate(moves):
            change = by_w[:, j] * dw
            for slope, entry in zip(inner, tangent.memory, strict=True):
                change += slope[:, j] * entry[j]
            for k in model.free.of(j):
                change[tangent.theta + k] += own[k]
            rows.append(change)
        new.append(rows)
    tangent.memory[:] = new or tangent.memory


def advance_tangent(
    model: MotionModel,
    tangent: Tangent,
    before: State,
    substep: tuple[State, Stiction, Crossing | None],
    u: Array,
    by: Array,
    dt: Array,
) -> None:
    """Advance the derivatives, in place, over a substep of dt (K, 1).

    before, substep : the state at its start, and what `step.substep` made of it
    u (K, n) [N m], by (E, K, n) : motor torque, and its derivatives by the torque parameters
    """
    after, stiction, crossing = substep
    h, n = dt[:, 0], len(tangent.q)
    held = None if stiction.sticking is None or not stiction.sticking.any() else stiction.sticking
    if held is not None:
        for j in range(n):
            tangent.w[j] *= ~held[:, j]
        if model.turns is not None:
            _hold_parts(model, tangent, before, held)
    start = None if crossing is None else [w[:, crossing.rows] for w in tangent.w]
    middle = _middle(before, after, dt)
    rates = memory_rates(model, middle, u, dt / 2)
    advance_memory(model, tangent, rates)
    M, friction, torques = _linearised(model, middle, u, stiction)
    # implicit in w: M da = -(... + by_w (dw + dt/2 da))
    A = inverse_of_free(M + h[:, None, None] / 2 * torques.by_w, held, model.turns)
    for j in range(n):
        tangent.q[j] += h / 2 * tangent.w[j]
    change = [_torque_change(model, tangent, friction, torques, by, i) for i in range(n)]
    out = np.empty_like(change[0])
    for i in range(n):
        for j in range(n):
            tangent.w[i] -= np.multiply(h * A[:, i, j], change[j], out=out)
        tangent.q[i] += np.multiply(h / 2, tangent.w[i], out=out)
    advance_memory(model, tangent, rates)
    if crossing is not None and start is not None:
        slow = model.plant.slow_like(of_parts(before.w, model.turns))
        cross_tangent(tangent, start, before.w[crossing.rows], crossing, h[crossing.rows], slow)


def _hold_parts(model: MotionModel, tangent: Tangent, before: State, held: Array) -> None:
    """Take off velocities that coupled parts cannot have while they are held (K, m)."""
    M = model.plant.mechanism.inertia(model.plant.p, before.q)
    kept = inverse_of_free(M, held, model.turns) @ M
    tangent.w[:] = [
        np.asarray(sum(row[:, j] * w for j, w in enumerate(tangent.w)))
        for row in np.moveaxis(kept, -2, 0)
    ]


def _middle(before: State, after: State, dt: Array) -> State:
    """State in the middle of a substep, by Hermite's cubic."""
    return State(
        (before.q + after.q) / 2 + (before.w - after.w) * dt / 8,
        (before.w + after.w) / 2,
        tuple((a + b) / 2 for a, b in zip(before.memory, after.memory, strict=True)),
    )


def _linearised(
    model: MotionModel, middle: State, u: Array, stiction: Stiction
) -> tuple[Array, Slopes, Partials]:
    """M, the slopes of friction, and those of the torques M a - h - B u + A' Tf in q, w and p.

    Slopes by q, w and u are those of what friction does to the joints, (K, n, n).
    """
    M, h = model.plant.dynamics(middle.q, middle.w)
    of = slopes(model.plant, model.friction, middle, u, model.free, model.reads, stiction)
    if stiction.braking is not None:
        of = _at_break_away(model, middle, u, stiction, of)
    force = h + driven(model.plant, u) - onto_joints(of.torque, model.turns)
    held = stiction.sticking
    a = solve(M, force) if held is None else constrained(M, force, held, model.turns)
    of = _onto_joints(model, of)
    by_q, by_w, by_p = model.plant.mechanism.partials(model.plant.p, middle.q, middle.w, a)
    return M, of, Partials(by_q if of.by_q is None else by_q + of.by_q, by_w + of.by_w, by_p)


def _onto_joints(model: MotionModel, of: Slopes) -> Slopes:
    """Slopes of friction by q, w and u as those of its torques on the joints."""
    if model.turns is None:
        return of
    turned = model.plant.mechanism.friction_map.T
    by_q, by_u = (None if by is None else turned @ by for by in (of.by_q, of.by_u))
    return of._replace(by_q=by_q, by_w=turned @ of.by_w, by_u=by_u)


def _torque_change(
    model: MotionModel, tangent: Tangent, of: Slopes, torques: Partials, by: Array, i: int
) -> Array:
    """Derivatives (D, K) of joint i's torque M a - h - B u + A' Tf at constant a."""
    n, nb = len(tangent.q), len(model.base)
    theta, p = tangent.theta, tangent.theta + len(model.free.joint)
    t = torques.by_q[:, i, 0] * tangent.q[0]
    out = np.empty_like(t)
    for j in range(n):
        if j:
            t += np.multiply(torques.by_q[:, i, j], tangent.q[j], out=out)
        t += np.multiply(torques.by_w[:, i, j], tangent.w[j], out=out)
    for part, share in model.parts_on(i):
        for slope, entry in zip(of.by_memory, tangent.memory, strict=True):
            t += np.multiply(share * slope[:, part], entry[part], out=out)
        for k in model.free.of(part):
            t[theta + k] += share * of.by_theta[k]
    for k, place in enumerate(model.base):
        t[p + k] += torques.by_p[:, i, place]
    if model.plant.mechanism.driven[i]:
        t[p + nb :] -= by[:, :, i]
    if of.by_u is not None:
        for j in range(n):
            t[p + nb :] += of.by_u[:, i, j] * by[:, :, j]
    return t


def _at_break_away(
    model: MotionModel, state: State, u: Array, stiction: Stiction, of: Slopes
) -> Slopes:
    """Slopes of friction that is at its break-away level, whatever w is, where joints are slow."""
    torque = braked(of.torque, stiction)
    level = torque != of.torque
    rows = np.flatnonzero(level.any(-1))
    if not len(rows):
        return of
    model = model.take(rows)
    plant = model.plant
    some = State(state.q[rows], state.w[rows], tuple(z[rows] for z in state.memory))
    x = inputs(plant, model.friction, some, u[rows])
    minimum = stiction.braking[rows]  # type: ignore[index]
    x = x._replace(w=np.where(level[rows], minimum, 1.0))
    law, theta, memory = model.friction.law, model.friction.theta, some.memory
    sign, zero = np.sign(minimum), 0.0 * x.w

    def limit(theta: Array) -> Array:
        return sign * law.limit(theta, x, memory) + zero

    own = of.by_theta.copy()
    of_limit = by_theta(theta, model.free, limit, None, zero)
    own[:, rows] = np.where(level[rows][:, model.free.joint].T, of_limit, own[:, rows])
    moves = ~level
    return of._replace(
        torque=torque,
        by_q=None if of.by_q is None else of.by_q * moves[..., None],
        by_w=of.by_w * moves[..., None],
        by_u=None if of.by_u is None else of.by_u * moves[..., None],
        by_memory=tuple(z * moves for z in of.by_memory),
        by_theta=own,
    )
