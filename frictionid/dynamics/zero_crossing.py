"""Joints whose velocity crosses zero within a substep: they stop there, or slide on.

A joint under a load below break-away stops; the others keep their momentum, so that a stop never
adds energy. A joint under more load passes through w = 0, where its friction changes side at once.
The crossing is located to first order, and what friction does since is made up for.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from frictionid.arrays import Array, namespace, times
from frictionid.dynamics.sliding_friction import Stiction, braked, friction_torque, is_sharp
from frictionid.dynamics.state import Instant, State, rows_of
from frictionid.dynamics.torque_balance import (
    Balance,
    balance,
    constrained,
    has_break_away,
    sticking_torque,
)
from frictionid.friction.coordinates import mobility, onto_joints, resting_parts


class Substep(NamedTuple):
    """A substep of dt (..., 1) [s] under the stiction at its start, w = 0 not yet looked at.

    before : state at its start; end : the instant that RK4 gives
    """

    before: State
    end: Instant
    stiction: Stiction
    dt: Array

    def rows(self, which: Array) -> Substep:
        """That of some rows; the substep itself where there are none to choose from, or all."""
        if not self.end.has_rows or bool(which.all()):
            return self
        before = State(self.before.q[which], self.before.w[which])
        dt = rows_of(self.dt, which, 1)
        return Substep(before, self.end.rows(which), self.stiction.rows(which), dt)


class Crossing(NamedTuple):
    """Joints that crossed w = 0 in a substep, of the k rows (...) that are true in `rows`.

    stops, passes : (k, m), parts that come to rest there, and those that slide on
    sticking : (k, m), all parts at rest then
    share : (k, m), of the substep, before the crossing
    jump : (k, n) [rad/s^2], change of the accelerations since, as friction changed its side or a
        part that was at rest has broken away
    M : (k, n, n); w : (k, n), velocities as if nothing had happened
    turns : (c, n), of coupled parts for one of each joint, or None
    """

    rows: Array
    stops: Array
    passes: Array
    sticking: Array
    share: Array
    jump: Array
    M: Array
    w: Array
    turns: Array | None


def crossing(substep: Substep) -> Crossing | None:
    """Joints whose velocity changed its sign; None where there is none."""
    direction, w = substep.stiction.direction, substep.end.velocities
    if direction is None:
        return None
    crossed: Array = direction * w < 0.0
    some: Any = crossed.any(-1)
    if not bool(some.any()):
        return None
    part = substep.rows(some)
    if part is substep:
        some = namespace(some).ones_like(some)
        return _crossing(substep, crossed)._replace(rows=some)
    return _crossing(part, crossed[some])._replace(rows=some)


def _crossing(substep: Substep, crossed: Array) -> Crossing:
    """Crossings of rows that all have one: which joints stop, which pass, and what that changes."""
    now = balance(substep.end, substep.stiction)
    resting = substep.stiction.sticking
    resting = namespace(crossed).zeros_like(crossed) if resting is None else resting
    stops = crossed & now.below_break_away(sticking_torque(now, crossed | resting))
    found = _located(substep, now, stops, crossed & ~stops)
    found = found._replace(sticking=stops | resting)
    since = _with_other_side(substep, now, found.passes)
    turned = _turned(substep, since, found)
    found = _stopped_too(found, turned)
    return found._replace(jump=_jump(now, since, found.sticking, resting | turned))


def _located(substep: Substep, now: Balance, stops: Array, passes: Array) -> Crossing:
    """Crossing at the share w0 / (w0 - w1) of the substep, for a velocity from w0 to w1."""
    w0, w1 = resting_parts(substep.before.w, now.turns), substep.end.velocities
    share = w0 / namespace(w0).where(stops | passes, w0 - w1, 1.0)
    w = substep.end.state.w
    return Crossing(stops, stops, passes, stops, share, 0.0 * w, now.M, w, now.turns)


def _with_other_side(substep: Substep, now: Balance, passes: Array) -> Balance:
    """Torques since the crossing: friction of joints that pass is that of the other side."""
    friction, memory = substep.end.friction, substep.end.state.memory
    other = Stiction(-substep.stiction.direction)  # type: ignore[operator]
    Tf = friction_torque(friction, substep.end.inputs, memory, other)
    return now._replace(friction=namespace(Tf).where(passes, Tf, now.friction))


def _turned(substep: Substep, since: Balance, found: Crossing) -> Array:
    """Joints that stop too, as a joint that stops no longer pulls at them."""
    w, _ = _velocity_after(found, substep.dt)
    w = resting_parts(w, found.turns)
    turned = (substep.stiction.direction * w < 0.0) & ~found.sticking & ~found.passes
    if not bool(turned.any()):
        return turned
    return turned & since.below_break_away(sticking_torque(since, found.sticking | turned))


def _stopped_too(found: Crossing, turned: Array) -> Crossing:
    """The crossing with joints that stop when the first of the others does."""
    xp = namespace(turned)
    first = xp.min(xp.where(found.stops, found.share, 0.0 * found.share + 1.0), axis=-1)
    return found._replace(
        stops=found.stops | turned,
        sticking=found.sticking | turned,
        share=xp.where(turned, first[..., None], found.share),
    )


def _jump(now: Balance, since: Balance, sticking: Array, at_stake: Array) -> Array:
    """Change of the accelerations (k, n) since the crossing.

    It may free a joint that is `at_stake`: at rest before, or as a joint no longer pulls at it.
    """
    if not bool(at_stake.any()):
        change = onto_joints(now.friction - since.friction, now.turns)
        return constrained(now.M, change, sticking, now.turns)
    Tf = sticking_torque(since, sticking)
    freed = sticking & ~since.below_break_away(Tf)
    Tf = namespace(Tf).where(freed, Tf, since.friction)
    a = constrained(now.M, now.left(Tf), sticking & ~freed, now.turns)
    return a - constrained(now.M, now.left(now.friction), sticking, now.turns)


def after_crossing(crossing: Crossing, substep: Substep) -> State:
    """State after a substep with a crossing.

    Joints that stop have w = 0 and the angle of the crossing, behind it friction would have pushed
    them back; they take any impulse, the others keep their momentum. Joints that pass have felt the
    friction of the other side since.
    """
    at, before, after = crossing.rows, substep.before, substep.end.state
    xp = namespace(after.w)
    whole = bool(at.all()) and crossing.w.ndim >= after.w.ndim  # with its batch axes as they are
    if whole:
        at = ...  # type: ignore[assignment]
    dt = xp.broadcast_to(substep.dt, after.w.shape)[at]
    w, since = _velocity_after(crossing, dt)
    share, stops = (x[..., : w.shape[-1]] for x in (crossing.share, crossing.stops))
    stopped = before.q[at] + share * dt / 2 * before.w[at]
    stopped = stopped + crossing.jump * since**2 / 2
    slid = after.q[at] + (w - crossing.w) * since / 2
    q = xp.where(stops, stopped, slid)
    if whole:
        return State(q, w, after.memory)
    q_all, w_all = (1.0 * x for x in (after.q, after.w))
    q_all[at] = q
    w_all[at] = w
    return State(q_all, w_all, after.memory)


def _velocity_after(crossing: Crossing, dt: Array) -> tuple[Array, Array]:
    """Velocities (k, n) at the end of the substep, and times (k, 1) since the crossing.

    Where a joint stops, M w is kept but for the impulses on sticking joints.
    """
    xp = namespace(crossing.w)
    since = (1.0 - crossing.share) * dt[..., :1]
    since = xp.where(crossing.passes | crossing.stops, since, 0.0 * since)
    since = xp.max(since, axis=-1)[..., None]
    momentum = times(crossing.M, crossing.w)
    kept = constrained(crossing.M, momentum, crossing.sticking, crossing.turns)
    stopped: Any = crossing.stops.any(-1)
    kept = xp.where(stopped[..., None], kept, crossing.w)
    return kept + crossing.jump * since, since


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
    jump = _break_away_jump(now, Tf, held, broken)
    since = _since(now, jump, part.stiction.margin, broken) * part.dt
    return BreakAway(xp.ones_like(some) if part is substep else some, jump, since)


def _break_away_jump(now: Balance, Tf: Array, sticking: Array, broken: Array) -> Array:
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


_FIRM = 0.9  # of the break-away level: joints held by more may break away soon


def stiction(now: Instant) -> Stiction:
    """Stiction at an instant: joints that stick, and how the others slide."""
    if not has_break_away(now.friction):
        return Stiction(None)
    w = now.velocities
    xp = namespace(w)
    least = 0.0 if is_sharp(now.friction) else now.plant.slow_like(w)
    slow = (xp.abs(w) <= least).any(-1)
    if not bool(slow.any()):
        return Stiction(xp.sign(w))
    if now.has_rows and not bool(slow.all()):
        return _spread(_near_rest(now.rows(slow)), slow, xp.sign(w))
    return _near_rest(now)


def _spread(part: Stiction, slow: Array, direction: Array) -> Stiction:
    """Stiction of all rows, from that of the slow ones; the others have a direction alone."""
    xp = namespace(direction)

    def spread(values: Array | None, elsewhere: Array | None = None) -> Array | None:
        if values is None:
            return None
        zero = xp.zeros(direction.shape, dtype=values.dtype, device=values.device)
        whole = zero if elsewhere is None else 1.0 * elsewhere
        whole[slow] = values
        return whole

    return Stiction(spread(part.direction, direction), *map(spread, part[1:]))


def _near_rest(now: Instant) -> Stiction:
    """Stiction where some joint is slow."""
    w = now.velocities
    xp, resting = namespace(w), w == 0.0
    if is_sharp(now.friction):
        braking, torques = None, balance(now, Stiction(xp.sign(w)))
    else:
        torques = balance(now, None)
        braking = _minimum_braking(torques, w, now.plant.slow_like(w))
        # a joint at rest feels that the others still slide
        torques = torques._replace(friction=braked(torques.friction, Stiction(None, None, braking)))
    Tf = sticking_torque(torques, resting)
    sticking = resting & torques.below_break_away(Tf)
    # a joint that breaks away slides against the friction that could not hold it
    direction = xp.where(resting, xp.sign(Tf), xp.sign(w))
    firm = (Tf > -_FIRM * torques.low) & (Tf < _FIRM * torques.high)
    margin = xp.minimum(torques.high - Tf, torques.low + Tf)
    return Stiction(direction, sticking, braking, sticking & firm, margin)


def _minimum_braking(torques: Balance, w: Array, least: Array) -> Array:
    """Break-away level against the velocity of slow joints under a load below it, else zero.

    least : (n,), speeds of joints that are no longer slow
    """
    xp = namespace(w)
    slow = xp.abs(w) <= least
    below = slow & (w != 0.0) & torques.below_break_away(sticking_torque(torques, slow))
    level = xp.where(w > 0, torques.high, -torques.low)
    return xp.where(below, level, 0.0 * level)
