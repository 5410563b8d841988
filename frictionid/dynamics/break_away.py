"""Joints that break away from rest within a substep, as their load grows beyond the level."""

from __future__ import annotations

from typing import Any, NamedTuple

from frictionid.arrays import Array, namespace
from frictionid.dynamics.state import State
from frictionid.dynamics.torque_balance import Balance, balance, constrained, sticking_torque
from frictionid.dynamics.zero_crossing import Crossing, Substep
from frictionid.friction.coordinates import mobility


class BreakAway(NamedTuple):
    """What breaks away within a substep changes, in the k rows (...) that are true in `rows`.

    jump : (k, n) [rad/s^2], by how much accelerations have grown at the end, from nothing
    since : (k, 1) [s], for how long
    """

    rows: Array
    jump: Array
    since: Array


def break_away(substep: Substep, crossed: Crossing | None) -> BreakAway | None:
    """Sticking joints whose load exceeds their break-away level at the end of the substep."""
    sticking, w = substep.stiction.sticking, substep.end.velocities
    if sticking is None:
        return None
    xp, moves = namespace(w), w != 0.0
    some = (sticking & ~moves).any(-1) & moves.any(-1)  # where nothing moves, no load changes
    if crossed is not None:
        some = some & ~crossed.rows
    if not bool(some.any()):
        return None
    substep = substep._replace(dt=xp.broadcast_to(substep.dt, (*some.shape, 1)))
    part = substep.rows(some)
    held: Any = part.stiction.sticking
    now = balance(part.end, part.stiction)
    Tf = sticking_torque(now, held)
    broken = held & ~now.below_break_away(Tf)
    if not bool(broken.any()):
        return None
    jump = _jump(now, Tf, held, broken)
    since = _since(now, jump, part.stiction.margin, broken) * part.dt
    return BreakAway(xp.ones_like(some) if part is substep else some, jump, since)


def _jump(now: Balance, Tf: Array, sticking: Array, broken: Array) -> Array:
    """Change of the accelerations (k, n) where sticking parts begin to slide."""
    free = namespace(Tf).where(broken, Tf, now.friction)
    a = constrained(now.M, now.left(free), sticking & ~broken, now.turns)
    return a - constrained(now.M, now.left(now.friction), sticking, now.turns)


def _since(now: Balance, jump: Array, margin: Array | None, broken: Array) -> Array:
    """Share (k, 1) of the substep after the load, growing evenly, has passed the level.

    It lacked `margin` of the level at the start, and exceeds it by M_jj jump_j at the end; of a
    coupled part M_jj is its inertia beside joints that are free.
    """
    xp, n = namespace(jump), jump.shape[-1]
    excess = xp.stack([xp.abs(jump[..., j]) * now.M[..., j, j] for j in range(n)], axis=-1)
    if now.turns is not None:
        inertia = 1.0 / xp.linalg.diagonal(mobility(now.M, now.turns))[..., n:]
        excess = xp.concat([excess, xp.abs(jump @ now.turns.T) * inertia], axis=-1)
    zero = 0.0 * excess
    share = excess / xp.maximum(excess + xp.maximum(margin, zero), zero + 1e-300)
    return xp.max(xp.where(broken, share, 0.0 * share), axis=-1)[..., None]


def after_break_away(broken: BreakAway, after: State) -> State:
    """State after a substep: accelerations grew evenly, from nothing, since the break-away."""
    at, since = broken.rows, broken.since
    q, w = 1.0 * after.q, 1.0 * after.w
    q[at] = q[at] + broken.jump * since**2 / 6
    w[at] = w[at] + broken.jump * since / 2
    return State(q, w, after.memory)
