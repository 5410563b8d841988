"""What a motion is differentiated by, and the derivatives that travel along it.

Directions, in this order, D of them:

    initial q (n), initial w (n), initial memory, free friction, base parameters, torque parameters

Friction and its memory are those of m parts, see `friction.coordinates`. Derivatives are arrays
T (..., s, D) of the s numbers of a state, q, w, memory. Over a substep they advance by the
variational equation

    M da + d(M a - h - B u + A' Tf)/d(q, w, ...) = 0,    dq' = dw,    dw' = da

linearised in the middle of the substep and integrated by the implicit midpoint rule in w: second
order, and stable however steep friction is. A held part's velocity A w has no derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace, times
from frictionid.friction import Friction
from frictionid.friction.coordinates import of_parts, turns_of
from frictionid.mechanics import Partials, Plant

from .law_derivatives import FreeTheta, LawReads, Slopes
from .state import Instant, State
from .torque_balance import braked, inverse_of_free
from .zero_crossing import Crossing

_GRAZE = 0.1  # of a slow speed


class MotionModel(NamedTuple):
    """Plant (p for each of K intervals) and friction, and what of them is free.

    free : entries of theta; base : places of the free base parameters
    reads : what the law reads besides a joint's velocity
    """

    plant: Plant
    friction: Friction
    free: FreeTheta
    base: tuple[int, ...]
    reads: LawReads

    def take(self, rows: Array) -> MotionModel:
        """The model of some rows; friction may have one entry for each, or one for all."""
        batch = np.ndim(self.friction.theta) > 2
        friction = self.friction[rows] if batch else self.friction
        return self._replace(plant=self.plant[rows], friction=friction)

    def instant(self, state: State, u: Array) -> Instant:
        """What determines accelerations at a state under motor torques u (K, n)."""
        return Instant(self.plant, self.friction, state, u)

    @property
    def turns(self) -> Array | None:
        """Turns (c, n) of coupled parts for one of each joint; None where there are none."""
        return turns_of(self.plant.mechanism, self.plant.p)

    @property
    def directions(self) -> int:
        """Number of free friction and base parameters."""
        return self.free.directions + len(self.base)


class MotorTorque(NamedTuple):
    """Motor torque of K intervals in S equal pieces, and its derivatives in E directions.

    u (S, K, n) [N m], by (S, E, K, n); moment (S, K, n) [N m s^2], that of the torque about the end
    of each piece beyond what its mean has, and moment_by (S, E, K, n). finer(rows, piece, parts):
    the torque of some intervals in parts of a piece; None where it is the same throughout.
    """

    u: Array
    by: Array
    moment: Array
    moment_by: Array
    finer: Callable[[Array, int, int], MotorTorque] | None = None

    def in_parts(self, rows: Array, piece: int, parts: int) -> MotorTorque:
        """The torque of some intervals in equal parts of a piece."""
        if parts > 1 and self.finer is not None:
            return self.finer(rows, piece, parts)
        return self.part(rows, np.repeat(piece, parts))

    def part(self, rows: Array, pieces: slice | Array) -> MotorTorque:
        """The torque of some intervals in some pieces."""
        u, by, moment, moment_by = (x[pieces][..., rows, :] for x in self[:4])
        return MotorTorque(u, by, moment, moment_by)

    def as_one(self, dt: Array) -> MotorTorque:
        """The torque of all pieces of dt (K,) [s] as that of one."""
        if len(self.u) == 1:
            return self
        ahead = (np.arange(len(self.u))[::-1] + 0.5)[:, None, None] * np.square(dt)[:, None]
        u, by = self.u.mean(axis=0, keepdims=True), self.by.mean(axis=0, keepdims=True)
        moment = ahead * (self.u - u) + self.moment
        moment_by = ahead[:, None] * (self.by - by) + self.moment_by
        sums = (x.sum(axis=0, keepdims=True) for x in (moment, moment_by))
        return MotorTorque(u, by, *sums)


Advance = Callable[[Array, MotorTorque, Array, bool], Array]
InHalves = Callable[[Array, MotorTorque, Array], None]


def advance_in_pieces(
    advance: Advance, in_halves: InHalves, motor: MotorTorque, dt: Array, parts: int
) -> None:
    """Advance intervals of length dt (K,) piece by piece, each halved where it is too long.

    advance : makes a substep of some rows under a torque of one piece, of lengths (k,) [s], and
        gives those of them, by their number, that are too long; none of which may not be halved
    in_halves : advances rows by all pieces of a torque, halves of them at once where they are even
    parts : of a piece, at most, a power of two
    """
    every, part = np.arange(len(dt)), dt / len(motor.u)
    for piece in range(len(motor.u)):
        again = advance(every, motor.in_parts(every, piece, 1), part, parts > 1)
        if len(again):
            in_halves(again, motor.in_parts(again, piece, parts), part[again] / parts)


def advance_in_halves(advance: Advance, rows: Array, motor: MotorTorque, part: Array) -> None:
    """Advance rows (k,) by the pieces of their torque, each part (k,) [s] long, in two halves."""
    half, every = len(motor.u) // 2, np.arange(len(rows))
    for first in (0, half):
        torque = motor.part(every, slice(first, first + half))
        again = advance(rows, torque.as_one(part), half * part, half > 1)
        if len(again):
            advance_in_halves(advance, rows[again], torque.part(again, slice(half)), part[again])


# --- A substep ------------------------------------------------------------------------------------


# How e entries of memory after some time change with those before it (..., e, e, m), a part's own
# velocity (..., e, m), and F free entries of theta (..., e, m, F).
MemoryRates = tuple[Array, Array, Array]


class Linear(NamedTuple):
    """The torques M a - h - B u + A' Tf of the joints, linearised in the middle of a substep.

    M, by_q, by_w, by_u (..., n, n); by_memory (..., e, m), of friction; by_theta (..., n, F);
    by_base (..., n, nb); rates : of the memory over half of the substep, None where it stands still
    """

    M: Array
    by_q: Array
    by_w: Array
    by_u: Array
    by_memory: Array
    by_theta: Array
    by_base: Array
    rates: MemoryRates | None


def linear(
    M: Array,
    friction: Slopes,
    partials: Partials,
    base: tuple[int, ...],
    motors: Array,
    turns: Array | None,
    rates: MemoryRates | None,
    feedback: Array | None = None,
) -> Linear:
    """Torques of the joints, of the slopes of friction at m parts and partials of M a - h.

    feedback : (..., 2, n), see `Plant.feedback`
    """
    by_q, by_w = partials.by_q, partials.by_w
    if feedback is not None:
        by_q = by_q + np.diag(motors) * feedback[..., 0, None, :]
        by_w = by_w + np.diag(motors) * feedback[..., 1, None, :]
    return Linear(
        M,
        by_q + _onto_joints(friction.by_q, turns),
        by_w + _onto_joints(friction.by_w, turns),
        _onto_joints(friction.by_u, turns) - np.diag(motors),
        friction.by_memory,
        _onto_joints(friction.by_theta, turns),
        partials.by_p[..., list(base)] + _onto_joints(friction.by_base, turns),
        rates,
    )


def _onto_joints(rows: Array, turns: Array | None) -> Array:
    """What friction of the parts (..., m, k) does to the joints (..., n, k)."""
    if turns is None:
        return rows
    n = turns.shape[-1]
    return rows[..., :n, :] + turns.T @ rows[..., n:, :]


def at_break_away(friction: Slopes, braking: Array, limit_by_theta: Array) -> Slopes:
    """Slopes of friction that is at its break-away level, whatever w is, where joints are slow.

    braking : (..., m), minimum braking torque; limit_by_theta : (..., m, F), of the level
    """
    torque = braked(friction.torque, braking)
    level = (torque != friction.torque)[..., None]
    by_theta = namespace(torque).sign(braking)[..., None] * limit_by_theta
    moves = np.where(level, 0.0, 1.0)
    by_q, by_w, by_u = (by * moves for by in (friction.by_q, friction.by_w, friction.by_u))
    by_memory, by_base = friction.by_memory * moves[..., None, :, 0], friction.by_base * moves
    by_theta = np.where(level, by_theta, friction.by_theta)
    return Slopes(torque, by_q, by_w, by_u, by_memory, by_theta, by_base)


def middle(before: State, after: State, dt: Array) -> State:
    """State in the middle of a substep, by Hermite's cubic."""
    return State(
        (before.q + after.q) / 2 + (before.w - after.w) * dt / 8,
        (before.w + after.w) / 2,
        tuple((a + b) / 2 for a, b in zip(before.memory, after.memory, strict=True)),
    )


def of_all_parts(w: Array, turns: Array | None) -> Array:
    """Derivatives (..., m, D) of velocities of all parts, from those of the joints."""
    return w if turns is None else np.concatenate([w, turns @ w], axis=-2)


def without_held(w: Array, held: Array, M: Array, turns: Array | None) -> Array:
    """Derivatives (..., n, D) of velocities without what parts that are held (..., m) cannot."""
    n = w.shape[-2]
    w = w * np.where(held[..., :n, None], 0.0, 1.0)
    if turns is None:
        return w
    return inverse_of_free(M, held, turns) @ M @ w


def advanced(
    T: Array, by: Array, step: Linear, held: Array | None, h: Array, turns: Array | None
) -> Array:
    """Derivatives T after a substep of h (..., 1, 1), of which held parts have none at its start.

    by : (..., n, E), derivatives of the motor torque in the last E directions
    """
    n, (*batch, size, _) = by.shape[-2], T.shape
    forcing = np.concatenate([step.by_theta, step.by_base, step.by_u @ by], axis=-1)
    forcing = np.concatenate([np.zeros((*batch, n, size)), forcing], axis=-1)
    q, w, memory = T[..., :n, :], T[..., n : 2 * n, :], T[..., 2 * n :, :]
    memory = _later(memory, w, step.rates, turns)
    # implicit in w: M da = -(... + by_w (dw + h/2 da))
    A = inverse_of_free(step.M + h / 2 * step.by_w, held, turns)
    q = q + h / 2 * w
    change = step.by_q @ q + step.by_w @ w + forcing
    if size > 2 * n:
        entries = _entries(memory, step.by_memory.shape[-2])
        friction = (step.by_memory[..., None] * entries).sum(axis=-3)
        change = change + _onto_joints(friction, turns)
    w = w - h * (A @ change)
    q = q + h / 2 * w
    return np.concatenate([q, w, _later(memory, w, step.rates, turns)], axis=-2)


def _entries(memory: Array, count: int) -> Array:
    """Derivatives (..., e, m, D) of each entry of the memory, from rows (..., e m, D)."""
    *batch, rows, D = memory.shape
    return memory.reshape(*batch, count, rows // count, D)


def _later(memory: Array, w: Array, rates: MemoryRates | None, turns: Array | None) -> Array:
    """Derivatives (..., e m, D) of the memory after the time of the rates."""
    if rates is None:
        return memory
    by_memory, by_w, by_theta = rates
    *batch, rows, D = memory.shape
    entries, F = _entries(memory, by_w.shape[-2]), by_theta.shape[-1]
    ahead = np.zeros((*entries.shape[:-1], 2 * w.shape[-2] + rows))
    behind = np.zeros((*entries.shape[:-1], D - ahead.shape[-1] - F))
    forcing = np.concatenate([ahead, by_theta, behind], axis=-1)
    out = by_w[..., None] * of_all_parts(w, turns)[..., None, :, :] + forcing
    out = out + (by_memory[..., None] * entries[..., None, :, :, :]).sum(axis=-3)
    return out.reshape(*batch, rows, D)


def crossed(T: Array, start: Array, w0: Array, crossing: Crossing, h: Array, slow: Array) -> Array:
    """Derivatives T (k, s, D) of motions that cross w = 0 in a substep.

    A joint that stops keeps the derivative of its angle and hands its momentum on. Of a joint that
    passes, friction switches its side earlier or later: dw changes by kick dt, where t = h w1/(w1 -
    w0) is the time since the crossing.

    start : derivatives (k, n, D) of w before the substep; w0 : (k, n) velocities before it; h : (k,
    1, 1) length; slow : (m,) speeds of parts near rest
    """
    n, turns = w0.shape[-1], crossing.turns
    before, w1 = of_parts(w0, turns), of_parts(crossing.w, turns)
    q, w = T[..., :n, :], T[..., n : 2 * n, :]
    stops, passes = crossing.stops[..., None], crossing.passes[..., None]
    q = q - np.where(stops[..., :n, :], h / 2, 0.0) * w
    # minus the derivative of the time since the crossing; bounded where w = 0 is just met
    gap = np.maximum((before - w1) ** 2, (_GRAZE * slow) ** 2)[..., None]
    apart = before[..., None] * of_all_parts(w, turns) - w1[..., None] * of_all_parts(start, turns)
    later = (np.where(passes, h / gap, 0.0) * apart).sum(axis=-2)
    w = w - crossing.jump[..., None] * later[..., None, :]
    free = inverse_of_free(crossing.M, crossing.sticking, turns)
    kept = free @ crossing.M @ w
    stopped: Any = crossing.stops.any(-1)
    w = np.where(stopped[..., None, None], kept, w)
    return np.concatenate([q, w, T[..., 2 * n :, :]], axis=-2)


def displacement(
    M: Array,
    resting: Array,
    moment: Array,
    regressor: Callable[[Array], Array],
    base: tuple[int, ...],
    turns: Array | None,
) -> tuple[Array, Array, Array]:
    """Way M^-1 moment (..., n), its derivatives by moment (..., n, n) and base (..., n, nb).

    resting : (..., m), parts at rest; regressor : of accelerations (..., n), the torques' by base
    parameters (..., n, all)
    """
    inner = inverse_of_free(M, resting, turns)
    way = times(inner, moment)
    if not base:
        return way, inner, inner[..., :0]
    # M way = moment, and M is linear in the base parameters
    change = (regressor(way) - regressor(0.0 * way))[..., list(base)]
    return way, inner, -inner @ change
