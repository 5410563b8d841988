"""Friction at rest and through w = 0, where it is a set and no function of the velocity.

A smoothed law cannot hold a joint at rest: it creeps under load, or chatters. So friction *grips*
slow joints: those with a load below the break-away level feel that level as long as they move, stop
where their velocity crosses zero (the projection keeps the momentum of the free joints, so it never
adds energy), and then rest with w = 0 exactly, as constraints, until their load exceeds the level.
The loads of joints that stick together are found by projected Gauss-Seidel [Stewart2000]. A joint
under more load slides on through w = 0, where its friction changes side at once, whatever the
smoothing of the law: a sum over the time since then makes up for what the substep did not know.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse, namespace, solve, times
from frictionid.friction import Friction, Inputs, Memory, at_rest
from frictionid.mechanics import Plant

SLOW = 0.1  # [rad/s]: slower joints may come to rest
_WIDTHS = 5.0  # of a law's smoothing: beyond them it does not show
_FIRM = 0.9  # of the break-away level: joints held by more may break away soon
_SWEEPS = 50
_SETTLED = 1e-12  # [N m]


class State(NamedTuple):
    """State of a machine: q (..., n) [rad], w (..., n) [rad/s] and the friction's memory."""

    q: Array
    w: Array
    memory: Memory = ()


class Grip(NamedTuple):
    """What friction does beyond the smooth law.

    side (..., n): which way a joint slides in a substep, so that a law smoothed at w = 0 is sharp
    there; None for laws that have no break-away level. held (..., n): joints at rest. brakes
    (..., n) [N m]: the least that friction brakes with, with the sign of the velocity, zero for
    joints that are left to the law. firm (..., n): held well below the break-away level. All None
    where no joint is slow.
    """

    side: Array | None
    held: Array | None = None
    brakes: Array | None = None
    firm: Array | None = None

    def take(self, which: Array) -> Grip:
        """That of some rows."""
        return Grip(*(None if x is None else x[which] for x in self))


def grip(plant: Plant, friction: Friction, state: State, u: Array) -> Grip:
    """Grip of friction on joints, above all on those that are slow or at rest (w = 0 exactly).

    Slow joints whose load is below break-away feel that level: under the smoothed law they would
    creep where the two balance, at 1.5 widths under 0.9 of the level. Joints at rest are held
    while their load is below it.
    """
    xp = namespace(state.w)
    if not holds(friction):
        return Grip(None)
    side, some = xp.sign(state.w), (xp.abs(state.w) <= SLOW).any(-1)
    if not bool(some.any()):
        return Grip(side)
    if not _divisible(plant, friction, state, u) or bool(some.all()):
        return _grip(plant, friction, state, u)
    inner = _grip(*rows(some, plant, friction, state, u, u)[:4])
    held, brakes = xp.zeros_like(state.w) > 0, xp.zeros_like(state.w)
    side, firm = 1.0 * side, xp.zeros_like(state.w) > 0
    side[some], held[some], brakes[some], firm[some] = inner
    return Grip(side, held, brakes, firm)


def _grip(plant: Plant, friction: Friction, state: State, u: Array) -> Grip:
    xp = namespace(state.w)
    now = balance(plant, friction, state, u, None)
    slow, resting = xp.abs(state.w) <= SLOW, state.w == 0.0
    Tf = _holding(now, slow)
    below = slow & _within(Tf, now)
    level = xp.where(state.w > 0, now.high, -now.low)
    brakes = xp.where(below & ~resting, level, 0.0 * level)
    if bool(resting.any()) and bool((below & ~resting).any()):
        # a joint at rest feels that the others still slide
        now = now._replace(sliding=braked(now.sliding, Grip(None, None, brakes)))
        Tf = _holding(now, resting)
        below = resting & _within(Tf, now)
    # a joint that breaks away slides against the friction that could not hold it
    side = xp.where(resting, xp.sign(Tf), xp.sign(state.w))
    firm = (Tf > -_FIRM * now.low) & (Tf < _FIRM * now.high)
    return Grip(side, below & resting, brakes, below & resting & firm)


class Crossing(NamedTuple):
    """Joints that crossed w = 0 in a substep, of the k rows (...) that are true in `rows`.

    stops, passes (k, n): those that come to rest there, and those that slide on to the other side;
    still (k, n): all at rest after it. share (k, n): of the substep, before the crossing. kick
    (k, n) [rad/s^2]: by how much friction of the other side accelerates. M (k, n, n); w (k, n):
    velocities as if nothing had happened.
    """

    rows: Array
    stops: Array
    passes: Array
    still: Array
    share: Array
    kick: Array
    M: Array
    w: Array


def crossing(
    plant: Plant, friction: Friction, before: State, after: State, u: Array, held: Grip
) -> Crossing | None:
    """Joints that crossed w = 0; under a load below break-away they come to rest."""
    if held.side is None:
        return None
    xp = namespace(after.w)
    crossed = held.side * after.w < 0.0
    some = crossed.any(-1)
    if not bool(some.any()):
        return None
    if _divisible(plant, friction, after, u) and not bool(some.all()):
        old, part, at = State(before.q[some], before.w[some]), held.take(some), crossed[some]
        plant, friction, after, u, _ = rows(some, plant, friction, after, u, u)
        return _crossed(plant, friction, old, after, u, part, at)._replace(rows=some)
    return _crossed(plant, friction, before, after, u, held, crossed)._replace(
        rows=xp.zeros_like(some) == xp.zeros_like(some)
    )


def _crossed(
    plant: Plant,
    friction: Friction,
    before: State,
    after: State,
    u: Array,
    held: Grip,
    crossed: Array,
) -> Crossing:
    xp = namespace(after.w)
    now = balance(plant, friction, after, u, held)
    resting = xp.zeros_like(crossed) if held.held is None else held.held
    stops = crossed & _within(_holding(now, crossed | resting), now)
    passes = crossed & ~stops
    x = inputs(plant, friction, after, u)
    other = resistance(friction, x, after.memory, Grip(-held.side))  # type: ignore[operator]
    gain = xp.where(passes, now.sliding - other, 0.0 * other)
    still = stops | resting
    kick = constrained(now.M, gain, still)
    share = before.w / xp.where(crossed, before.w - after.w, 1.0)
    return Crossing(crossed, stops, passes, still, share, kick, now.M, after.w)


def beyond(crossing: Crossing, before: State, after: State, dt: Array) -> State:
    """State behind a crossing.

    Joints that stop have w = 0 and the angle of the crossing, behind it friction would have pushed
    them back; they take any impulse, the others keep their momentum. Joints that pass have felt the
    friction of the other side since.
    """
    xp, at = namespace(after.w), crossing.rows
    span = xp.broadcast_to(dt, after.w.shape)[at]
    since = xp.where(crossing.passes, (1.0 - crossing.share) * span, 0.0 * span)
    since = xp.max(since, axis=-1)[..., None]
    w = crossing.w + crossing.kick * since
    w = constrained(crossing.M, times(crossing.M, w), crossing.still)
    some = crossing.stops.any(-1)[..., None]
    w = xp.where(some, w, crossing.w + crossing.kick * since)
    stopped = before.q[at] + crossing.share * span / 2 * before.w[at]
    slid = after.q[at] + crossing.kick * since**2 / 2
    q_all, w_all = (1.0 * x for x in (after.q, after.w))
    q_all[at] = xp.where(crossing.stops, stopped, slid)
    w_all[at] = w
    return State(q_all, w_all, after.memory)


def resistance(friction: Friction, x: Inputs, memory: Memory, grip: Grip | None) -> Array:
    """Friction torque (..., n) [N m] of joints that slide to their side, or are gripped."""
    if grip is None:
        return friction.torque(x, memory)
    return braked(friction.torque(x._replace(w=sliding(friction, x.w, grip)), memory), grip)


def sliding(friction: Friction, w: Array, grip: Grip) -> Array:
    """Velocities (..., n) at which the law is asked: beyond its smoothing, to the joint's side."""
    least = _smoothing(friction)
    if grip.side is None or least == 0.0:
        return w
    xp = namespace(w)
    beyond = grip.side * xp.maximum(grip.side * w, 0.0 * w + least)
    return xp.where(grip.side == 0.0, w, beyond)


def _smoothing(friction: Friction) -> float:
    """Speed [rad/s] below which a law's smoothing shows; 0 where it is wide on purpose."""
    reach = _WIDTHS * float(getattr(friction.law, "width", SLOW / _WIDTHS))
    return reach if reach <= SLOW * (1 + 1e-9) else 0.0


def braked(Tf: Array, grip: Grip) -> Array:
    """Friction torque (..., n) [N m], on gripped joints no less than the break-away level."""
    if grip.brakes is None:
        return Tf
    xp = namespace(Tf)
    most = xp.where(grip.brakes < 0, xp.minimum(Tf, grip.brakes), Tf)
    return xp.where(grip.brakes > 0, xp.maximum(Tf, grip.brakes), most)


def inputs(plant: Plant, friction: Friction, state: State, u: Array) -> Inputs:
    """What friction may depend on at a state; the bearing load only for laws that use it."""
    load = plant.load(state.q, state.w, u) if friction.law.uses_load else 0.0 * state.w
    return Inputs(state.q, state.w, u, load)


def driven(plant: Plant, u: Array) -> Array:
    """Torques B u (..., n) [N m]: those of joints that have a motor."""
    xp = namespace(u)
    driven = [float(d) for d in plant.mechanism.description.driven]
    return u * xp.asarray(driven, dtype=u.dtype)


def constrained(M: Array, f: Array, held: Array) -> Array:
    """Solution of M a = f for the free joints, with a = 0 for the held ones."""
    xp = namespace(M)
    free = 1.0 - xp.astype(held, M.dtype)
    both = free[..., :, None] * free[..., None, :]
    return solve(M * both + _diagonal(1.0 - free), f * free)


def _diagonal(x: Array) -> Array:
    xp = namespace(x)
    return x[..., None] * xp.eye(x.shape[-1], dtype=x.dtype)


def _divisible(plant: Plant, friction: Friction, state: State, u: Array) -> bool:
    """Whether there are rows, and the state has the batch axes of all that takes part."""
    batch = state.q.shape[:-1]
    axes = (plant.p.shape[:-1], friction.theta.shape[:-2], u.shape[:-1])
    return bool(batch) and np.broadcast_shapes(batch, *axes) == tuple(batch)


def rows(
    which: Array, plant: Plant, friction: Friction, state: State, u: Array, dt: Array
) -> tuple[Plant, Friction, State, Array, Array]:
    """Those rows of all that takes part in a step, which (...) true or false."""
    xp, shape = namespace(state.q), tuple(state.q.shape[:-1])

    def some(x: Array, tail: int) -> Array:
        batch = tuple(x.shape[: x.ndim - tail])
        if not batch or set(batch) == {1}:
            return xp.reshape(x, x.shape[x.ndim - tail :])
        return xp.broadcast_to(x, (*shape, *x.shape[x.ndim - tail :]))[which]

    physical = plant.parameters  # only bearing loads need them
    if friction.law.uses_load:
        physical = {name: some(xp.asarray(v), 0) for name, v in physical.items()}
    return (
        replace(plant, parameters=physical, p=some(plant.p, 1)),
        replace(friction, theta=some(friction.theta, 2)),
        State(state.q[which], state.w[which], tuple(some(z, 1) for z in state.memory)),
        some(u, 1),
        some(dt, 1),
    )


class Balance(NamedTuple):
    """What acts on the joints: M, f = h + B u, friction while sliding, and break-away levels."""

    M: Array
    f: Array
    sliding: Array
    low: Array
    high: Array


def balance(plant: Plant, friction: Friction, state: State, u: Array, held: Grip | None) -> Balance:
    """Torques at a state; `low` and `high` limit negative and positive friction, both positive."""
    M, h = plant.dynamics(state.q, state.w)
    x = inputs(plant, friction, state, u)
    one = 0.0 * state.w + 1.0
    law, theta, memory = friction.law, friction.theta, state.memory
    low, high = (law.limit(theta, x._replace(w=s * one), memory) for s in (-1.0, 1.0))
    Tf = resistance(friction, x, memory, held)
    return Balance(M, h + driven(plant, u), Tf, low + 0.0 * Tf, high + 0.0 * Tf)


def _holding(now: Balance, candidates: Array) -> Array:
    """Friction (..., n) that keeps the candidates from accelerating, as far as its levels allow.

    Projected Gauss-Seidel on a_j = 0 with -low <= Tf_j <= high. It starts from the torques that
    hold all candidates: where the levels allow these, they are the answer.
    """
    M, f, sliding, low, high = now
    xp = namespace(M)
    A = inverse(M)
    holding = f - times(M, constrained(M, f - sliding, candidates))
    clipped = xp.minimum(xp.maximum(holding, -low), high)
    Tf = xp.where(candidates, clipped, sliding)
    columns = [Tf[..., j] for j in range(M.shape[-1])]
    for _ in range(_SWEEPS):
        moved = False
        for j in range(len(columns)):
            a = sum(A[..., j, i] * (f[..., i] - columns[i]) for i in range(len(columns)))
            wanted = xp.maximum(columns[j] + a / A[..., j, j], -low[..., j])
            wanted = xp.minimum(wanted, high[..., j])
            new = xp.where(candidates[..., j], wanted, columns[j])
            # NaN (a motion that has diverged) counts as settled, whatever the others do
            moved = moved or bool((xp.abs(new - columns[j]) > _SETTLED).any())
            columns[j] = new
        if not moved:
            break
    return xp.stack(columns, axis=-1)


def _within(Tf: Array, now: Balance) -> Array:
    """Where friction is within its levels."""
    return (Tf > -now.low) & (Tf < now.high)


def holds(friction: Friction) -> bool:
    """Whether friction has a break-away level; bristles hold a joint in other ways."""
    theta = friction.theta[..., None, :, :]
    x = at_rest(namespace(theta).ones((1, friction.n), dtype=theta.dtype))
    return bool((friction.law.limit(theta, x, friction.law.start(theta, x)) > 0).any())
