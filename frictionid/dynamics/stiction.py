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
_NARROW = 1e-7  # [rad/s], smoothing of a law that is made sharp
_FIRM = 0.9  # of the break-away level: joints held by more may break away soon
_SWEEPS = 50
_SETTLED = 1e-12  # [N m]


class State(NamedTuple):
    """State of a machine: q (..., n) [rad], w (..., n) [rad/s] and the friction's memory."""

    q: Array
    w: Array
    memory: Memory = ()


class Stiction(NamedTuple):
    """What friction does beyond the smooth law.

    side (..., n): which way a joint slides in a substep, so that a law smoothed at w = 0 is sharp
    there; None for laws that have no break-away level. held (..., n): joints at rest. minimum
    (..., n) [N m]: the least that friction minimum with, with the sign of the velocity, zero for
    joints that are left to the law; None for laws that are sharp. margin (..., n) [N m]: what the
    load of joints at rest lacks of the break-away level, and firm (..., n) where it lacks much. All
    None where no joint is slow.
    """

    side: Array | None
    held: Array | None = None
    minimum: Array | None = None
    firm: Array | None = None
    margin: Array | None = None

    def take(self, which: Array) -> Stiction:
        """That of some rows."""
        return Stiction(*(None if x is None else x[which] for x in self))


def stiction(plant: Plant, friction: Friction, state: State, u: Array) -> Stiction:
    """Grip of friction on joints, above all on those that are slow or at rest (w = 0 exactly).

    Joints at rest are held while their load is below break-away. Under a law whose smoothing is
    wide others would creep where law and load balance, at 1.5 widths under 0.9 of the level: those
    that are slow, under a load below break-away, feel that level.
    """
    xp = namespace(state.w)
    if not holds(friction):
        return Stiction(None)
    slowest = 0.0 if is_sharp(friction) else SLOW
    side, some = xp.sign(state.w), (xp.abs(state.w) <= slowest).any(-1)
    if not bool(some.any()):
        return Stiction(side)
    if not divisible(plant, friction, state, u) or bool(some.all()):
        return _stiction(plant, friction, state, u)
    inner = _stiction(*rows(some, plant, friction, state, u, u)[:4])
    out: list[Array | None] = []
    for like, part in zip((side, *inner[1:]), inner, strict=True):
        if part is None:
            out.append(None)
            continue
        whole = 1.0 * side if like is side else xp.zeros(side.shape, dtype=part.dtype)
        whole[some] = part
        out.append(whole)
    return Stiction(*out)


def _stiction(plant: Plant, friction: Friction, state: State, u: Array) -> Stiction:
    xp = namespace(state.w)
    side, resting = xp.sign(state.w), state.w == 0.0
    now = balance(plant, friction, state, u, Stiction(side) if is_sharp(friction) else None)
    minimum = None
    if not is_sharp(friction):
        slow = xp.abs(state.w) <= SLOW
        below = slow & ~resting & within(holding(now, slow), now)
        level = xp.where(state.w > 0, now.high, -now.low)
        minimum = xp.where(below, level, 0.0 * level)
        # a joint at rest feels that the others still slide
        now = now._replace(sliding=braked(now.sliding, Stiction(None, None, minimum)))
    Tf = holding(now, resting)
    held = resting & within(Tf, now)
    # a joint that breaks away slides against the friction that could not hold it
    side = xp.where(resting, xp.sign(Tf), side)
    firm = (Tf > -_FIRM * now.low) & (Tf < _FIRM * now.high)
    margin = xp.minimum(now.high - Tf, now.low + Tf)
    return Stiction(side, held, minimum, held & firm, margin)


def friction_torque(
    friction: Friction, x: Inputs, memory: Memory, stiction: Stiction | None
) -> Array:
    """Friction torque (..., n) [N m] of joints that slide to their side, or are gripped."""
    if stiction is None:
        return friction.torque(x, memory)
    w = sliding(friction, x.w, stiction)
    return braked(sharp(friction, stiction).torque(x._replace(w=w), memory), stiction)


def sliding(friction: Friction, w: Array, stiction: Stiction) -> Array:
    """Velocities (..., n) at which the law is asked: beyond its smoothing, to the joint's side."""
    least = 4.0 * _WIDTHS * _NARROW if is_sharp(friction) else _smoothing(friction)
    if stiction.side is None or least == 0.0:
        return w
    xp = namespace(w)
    beyond = stiction.side * xp.maximum(stiction.side * w, 0.0 * w + least)
    return xp.where(stiction.side == 0.0, w, beyond)


def _smoothing(friction: Friction) -> float:
    """Speed [rad/s] below which a law's smoothing shows; 0 where it is wide on purpose."""
    reach = _WIDTHS * friction.law.width
    return reach if reach <= SLOW * (1 + 1e-9) else 0.0


def is_sharp(friction: Friction) -> bool:
    """Whether a law's smoothing only stands for a sharp step at w = 0, and is no part of physics.

    So is a narrow tanh; an arctangent shows at all speeds.
    """
    return friction.law.shape == "tanh" and _smoothing(friction) > 0.0


def sharp(friction: Friction, stiction: Stiction) -> Friction:
    """Friction without smoothing for joints that slide to their side."""
    if stiction.side is None or not is_sharp(friction):
        return friction
    return replace(friction, law=friction.law.with_width(_NARROW))


def braked(Tf: Array, stiction: Stiction) -> Array:
    """Friction torque (..., n) [N m], on gripped joints no less than the break-away level."""
    if stiction.minimum is None:
        return Tf
    xp = namespace(Tf)
    most = xp.where(stiction.minimum < 0, xp.minimum(Tf, stiction.minimum), Tf)
    return xp.where(stiction.minimum > 0, xp.maximum(Tf, stiction.minimum), most)


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


def divisible(plant: Plant, friction: Friction, state: State, u: Array) -> bool:
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


def balance(
    plant: Plant, friction: Friction, state: State, u: Array, held: Stiction | None
) -> Balance:
    """Torques at a state; `low` and `high` limit negative and positive friction, both positive."""
    M, h = plant.dynamics(state.q, state.w)
    x = inputs(plant, friction, state, u)
    one = 0.0 * state.w + 1.0
    law, theta, memory = friction.law, friction.theta, state.memory
    low, high = (law.limit(theta, x._replace(w=s * one), memory) for s in (-1.0, 1.0))
    Tf = friction_torque(friction, x, memory, held)
    return Balance(M, h + driven(plant, u), Tf, low + 0.0 * Tf, high + 0.0 * Tf)


def holding(now: Balance, candidates: Array) -> Array:
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


def within(Tf: Array, now: Balance) -> Array:
    """Where friction is within its levels."""
    return (Tf > -now.low) & (Tf < now.high)


def holds(friction: Friction) -> bool:
    """Whether friction has a break-away level; bristles hold a joint in other ways."""
    theta = friction.theta[..., None, :, :]
    x = at_rest(namespace(theta).ones((1, friction.n), dtype=theta.dtype))
    return bool((friction.law.limit(theta, x, friction.law.start(theta, x)) > 0).any())
