"""Joints near rest: which stick, which stop or slide on as they cross w = 0, which break away.

A joint under a load below break-away stops; the others keep their momentum, so that a stop never
adds energy. A joint under more load passes through w = 0, where its friction changes side at once.
The crossing is located to first order, and what friction does since is made up for.
"""

from typing import Any, NamedTuple

from frictionid.arrays import Array, namespace, times
from frictionid.friction.coordinates import mobility, onto_joints, resting_parts

from .state import Instant, State, rows_of
from .torque_balance import (
    Balance,
    Stiction,
    balance,
    braked,
    constrained,
    friction_torque,
    has_break_away,
    is_sharp,
    sticking_torque,
)

_FIRM = 0.9  # of the break-away level: joints held by more may break away soon


def stiction(now: Instant) -> Stiction:
    """Stiction at an instant: joints that stick, and how the others slide."""
    if not has_break_away(now.friction):
        return Stiction(None)
    w = now.velocities
    xp = namespace(w)
    least = 0.0 if is_sharp(now.friction.law) else now.plant.slow_like(w)
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
    xp, braking = namespace(w), None
    if is_sharp(now.friction.law):
        torques = balance(now, Stiction(xp.sign(w)))
    else:
        torques = balance(now, None)
        slow = xp.abs(w) <= now.plant.slow_like(w)
        braking = minimum_braking(torques, sticking_torque(torques, slow), w, slow)
        # a joint at rest feels that the others still slide
        torques = torques._replace(friction=braked(torques.friction, braking))
    return stiction_at(torques, sticking_torque(torques, w == 0.0), w, braking)


def minimum_braking(torques: Balance, held: Array, w: Array, slow: Array) -> Array:
    """Break-away level against the velocity of slow joints under a load below it, else zero.

    held : (..., m), friction that holds all slow joints
    """
    xp = namespace(w)
    below = slow & (w != 0.0) & torques.below_break_away(held)
    level = xp.where(w > 0, torques.high, -torques.low)
    return xp.where(below, level, 0.0 * level)


def stiction_at(torques: Balance, held: Array, w: Array, braking: Array | None) -> Stiction:
    """Stiction by the friction (..., m) that holds all joints at rest."""
    xp, resting = namespace(w), w == 0.0
    sticking = resting & torques.below_break_away(held)
    # a joint that breaks away slides against the friction that could not hold it
    direction = xp.where(resting, xp.sign(held), xp.sign(w))
    firm = sticking & (held > -_FIRM * torques.low) & (held < _FIRM * torques.high)
    margin = xp.minimum(torques.high - held, torques.low + held)
    return Stiction(direction, sticking, braking, firm, margin)


class Substep(NamedTuple):
    """A substep of dt (..., 1) [s] under the stiction at its start, w = 0 not yet looked at.

    before : state at its start; end : the instant that RK4 gives
    """

    before: State
    end: Instant
    stiction: Stiction
    dt: Array

    def rows(self, which: Array) -> "Substep":
        """The substep of some rows; itself where there are none to choose from, or all."""
        if not self.end.has_rows or bool(which.all()):
            return self
        before = State(self.before.q[which], self.before.w[which])
        dt = rows_of(self.dt, which, 1)
        return Substep(before, self.end.rows(which), self.stiction.rows(which), dt)


class Crossing(NamedTuple):
    """Parts that crossed w = 0 in a substep, in k rows.

    stops, passes : (k, m), parts that come to rest there, and those that slide on
    sticking : (k, m), all parts at rest then
    share : (k, m), of the substep, before the crossing
    jump : (k, n) [rad/s^2], change of the accelerations since, as friction changed its side or a
        part that was at rest has broken away
    M : (k, n, n); w : (k, n), velocities as if nothing had happened
    turns : (c, n), of coupled parts for one of each joint, or None
    """

    stops: Array
    passes: Array
    sticking: Array
    share: Array
    jump: Array
    M: Array
    w: Array
    turns: Array | None

    def velocity_after(self, dt: Array) -> tuple[Array, Array]:
        """Velocities (k, n) at the end of a substep of dt (k, 1), times (k, 1) since the crossing.

        Where a joint stops, M w is kept but for the impulses on sticking joints.
        """
        xp = namespace(self.w)
        since = xp.where(self.passes | self.stops, (1.0 - self.share) * dt, 0.0 * self.share)
        since = xp.max(since, axis=-1)[..., None]
        kept = constrained(self.M, times(self.M, self.w), self.sticking, self.turns)
        stopped: Any = self.stops.any(-1)
        kept = xp.where(stopped[..., None], kept, self.w)
        return kept + self.jump * since, since

    def state_after(self, before: State, q: Array, dt: Array) -> tuple[Array, Array]:
        """Angles and velocities (k, n) at the end, from angles q as if nothing had happened.

        Joints that stop have w = 0 and the angle of the crossing, behind it friction would have
        pushed them back; they take any impulse, the others keep their momentum. Joints that pass
        have felt the friction of the other side since.
        """
        w, since = self.velocity_after(dt)
        n = w.shape[-1]
        stopped = before.q + self.share[..., :n] * dt / 2 * before.w
        stopped = stopped + self.jump * since**2 / 2
        slid = q + (w - self.w) * since / 2
        return namespace(w).where(self.stops[..., :n], stopped, slid), w


def after_crossing(substep: Substep) -> tuple[State, Array, Crossing] | None:
    """State behind what crosses w = 0, the rows (...) that do, and their crossing; or None."""
    direction, w = substep.stiction.direction, substep.end.velocities
    if direction is None:
        return None
    crossed: Array = direction * w < 0.0
    crosses: Any = crossed.any(-1)
    if not bool(crosses.any()):
        return None
    part, state = substep.rows(crosses), substep.end.state
    if part is substep:
        rows, crosses = ..., namespace(w).ones_like(crosses)
    else:
        rows, crossed = crosses, crossed[crosses]
    crossing = _crossing(part, crossed)
    q, w = crossing.state_after(part.before, part.end.state.q, part.dt)
    return state._replace(q=_with(state.q, rows, q), w=_with(state.w, rows, w)), crosses, crossing


def _with(whole: Array, rows: Any, values: Array) -> Array:
    """A copy of an array with other values in some rows."""
    if rows is ...:
        return values
    out = 1.0 * whole
    out[rows] = values
    return out


def _crossing(substep: Substep, crossed: Array) -> Crossing:
    """Crossings of rows that all have one: which joints stop, which pass, and what that changes."""
    end, direction = substep.end, substep.stiction.direction
    now = balance(end, substep.stiction)
    resting = substep.stiction.sticking
    resting = namespace(crossed).zeros_like(crossed) if resting is None else resting
    held = sticking_torque(now, crossed | resting)
    start = resting_parts(substep.before.w, now.turns)
    crossing = located(now, held, crossed, resting, start, end.velocities, end.state.w)
    other = Stiction(-direction)  # type: ignore[operator]
    Tf = friction_torque(end.friction, end.inputs, end.state.memory, other)
    since = since_crossing(now, Tf, crossing)
    turned = turned_back(crossing, direction, substep.dt)  # type: ignore[arg-type]
    if bool(turned.any()):
        turned = turned & since.below_break_away(sticking_torque(since, crossing.sticking | turned))
    crossing = stopped_too(crossing, turned)
    at_stake: Any = (resting | turned).any(-1)
    held = sticking_torque(since, crossing.sticking) if bool(at_stake.any()) else since.friction
    return crossing._replace(jump=crossing_jump(now, since, held, crossing, at_stake))


def located(
    now: Balance, held: Array, crossed: Array, resting: Array, w0: Array, w1: Array, w: Array
) -> Crossing:
    """Crossing at the share w0 / (w0 - w1) of the substep, for velocities of parts from w0 to w1.

    held : friction (..., m) that holds what crosses or rests; w : of the joints, at the end
    """
    stops = crossed & now.below_break_away(held)
    share = w0 / namespace(w0).where(crossed, w0 - w1, 1.0)
    jump = 0.0 * w
    return Crossing(stops, crossed & ~stops, stops | resting, share, jump, now.M, w, now.turns)


def since_crossing(now: Balance, other: Array, crossing: Crossing) -> Balance:
    """Torques since the crossing: friction of joints that pass is that of the other side."""
    return now._replace(friction=namespace(other).where(crossing.passes, other, now.friction))


def turned_back(crossing: Crossing, direction: Array, dt: Array) -> Array:
    """Joints (..., m) that turn back, too, as a joint that stops no longer pulls at them."""
    w = resting_parts(crossing.velocity_after(dt)[0], crossing.turns)
    return (direction * w < 0.0) & ~crossing.sticking & ~crossing.passes


def stopped_too(crossing: Crossing, turned: Array) -> Crossing:
    """The crossing with joints that stop when the first of the others does."""
    xp = namespace(turned)
    first = xp.min(xp.where(crossing.stops, crossing.share, 1.0 + 0.0 * crossing.share), axis=-1)
    return crossing._replace(
        stops=crossing.stops | turned,
        sticking=crossing.sticking | turned,
        share=xp.where(turned, first[..., None], crossing.share),
    )


def crossing_jump(
    now: Balance, since: Balance, held: Array, crossing: Crossing, at_stake: Array
) -> Array:
    """Change of the accelerations (k, n) since the crossing.

    It may free a joint in rows (k,) where one is at stake, at rest before, or as a joint no longer
    pulls at it; held (k, m) is the friction that holds all that stick.
    """
    sticking = crossing.sticking
    freed = sticking & ~since.below_break_away(held) & at_stake[..., None]
    change = onto_joints(now.friction - since.friction, now.turns)
    return namespace(held).where(
        at_stake[..., None],
        _change(now, since.friction, held, sticking, freed),
        constrained(now.M, change, sticking, now.turns),
    )


def _change(now: Balance, friction: Array, held: Array, sticking: Array, freed: Array) -> Array:
    """Change of the accelerations (k, n) by another friction, and as some of what sticks is freed.

    held : (k, m), friction that holds what sticks
    """
    Tf = namespace(held).where(freed, held, friction)
    a = constrained(now.M, now.left(Tf), sticking & ~freed, now.turns)
    return a - constrained(now.M, now.left(now.friction), sticking, now.turns)


def after_break_away(substep: Substep, crossed: Array | None) -> State:
    """State at the end, where sticking joints slide whose load has grown beyond their level.

    crossed : rows (...) in which a joint has crossed w = 0, which are left as they are
    """
    sticking, w, after = substep.stiction.sticking, substep.end.velocities, substep.end.state
    if sticking is None:
        return after
    xp, moves = namespace(w), w != 0.0
    loads = (sticking & ~moves).any(-1) & moves.any(-1)  # where nothing moves, no load changes
    if crossed is not None:
        loads = loads & ~crossed
    if not bool(loads.any()):
        return after
    substep = substep._replace(dt=xp.broadcast_to(substep.dt, (*loads.shape, 1)))
    part = substep.rows(loads)
    now = balance(part.end, part.stiction)
    held: Any = part.stiction.sticking
    margin: Any = part.stiction.margin
    q, w = slid(now, sticking_torque(now, held), held, margin, part.end.state, part.dt)
    rows = ... if part is substep else loads
    return after._replace(q=_with(after.q, rows, q), w=_with(after.w, rows, w))


def slid(
    now: Balance, held: Array, sticking: Array, margin: Array, state: State, dt: Array
) -> tuple[Array, Array]:
    """Angles and velocities (k, n) as accelerations grow evenly, from nothing, since break-away.

    Of dt (k, 1), the share after the load has passed the level: it lacked `margin` of it at the
    start, and exceeds it by M_jj jump_j at the end; of a coupled part M_jj is its inertia beside
    joints that are free. held (k, m) : friction that holds what sticks
    """
    xp, n, turns = namespace(held), state.q.shape[-1], now.turns
    broken = sticking & ~now.below_break_away(held)
    jump = _change(now, now.friction, held, sticking, broken)
    excess = xp.stack([xp.abs(jump[..., j]) * now.M[..., j, j] for j in range(n)], axis=-1)
    if turns is not None:
        inertia = 1.0 / xp.linalg.diagonal(mobility(now.M, turns))[..., n:]
        excess = xp.concat([excess, xp.abs(jump @ turns.T) * inertia], axis=-1)
    zero = 0.0 * excess
    share = excess / xp.maximum(excess + xp.maximum(margin, zero), zero + 1e-300)
    since = xp.max(xp.where(broken, share, zero), axis=-1)[..., None] * dt
    return state.q + jump * since**2 / 6, state.w + jump * since / 2
