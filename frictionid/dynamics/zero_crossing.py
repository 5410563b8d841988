"""What happens within a substep: joints stop or pass through w = 0, or break away from rest.

Each event is located to first order, and what friction then does differently is made up for.
"""

from __future__ import annotations

from typing import NamedTuple

from frictionid.arrays import Array, namespace, times
from frictionid.dynamics.stiction import (
    State,
    Stiction,
    balance,
    constrained,
    divisible,
    friction_torque,
    holding,
    inputs,
    rows,
    within,
)
from frictionid.friction import Friction
from frictionid.mechanics import Plant


class Crossing(NamedTuple):
    """Joints that crossed w = 0 in a substep, of the k rows (...) that are true in `rows`.

    stops, passes (k, n): those that come to rest there, and those that slide on to the other side;
    still (k, n): all at rest then. share (k, n): of the substep, before the crossing. kick (k, n)
    [rad/s^2]: by how much accelerations differ since, as friction changed its side or a joint that
    was at rest has broken away. M (k, n, n); w (k, n):
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
    plant: Plant,
    friction: Friction,
    before: State,
    after: State,
    u: Array,
    held: Stiction,
    dt: Array,
) -> Crossing | None:
    """Joints that crossed w = 0 within dt; under a load below break-away they come to rest."""
    if held.side is None:
        return None
    xp = namespace(after.w)
    crossed = held.side * after.w < 0.0
    some = crossed.any(-1)
    if not bool(some.any()):
        return None
    if divisible(plant, friction, after, u) and not bool(some.all()):
        old, part, at = State(before.q[some], before.w[some]), held.take(some), crossed[some]
        plant, friction, after, u, dt = rows(some, plant, friction, after, u, dt)
        return _crossed(plant, friction, old, after, u, part, at, dt)._replace(rows=some)
    return _crossed(plant, friction, before, after, u, held, crossed, dt)._replace(
        rows=xp.zeros_like(some) == xp.zeros_like(some)
    )


def _crossed(
    plant: Plant,
    friction: Friction,
    before: State,
    after: State,
    u: Array,
    held: Stiction,
    crossed: Array,
    dt: Array,
) -> Crossing:
    xp = namespace(after.w)
    now = balance(plant, friction, after, u, held)
    resting = xp.zeros_like(crossed) if held.held is None else held.held
    stops = crossed & within(holding(now, crossed | resting), now)
    passes = crossed & ~stops
    x = inputs(plant, friction, after, u)
    other = friction_torque(friction, x, after.memory, Stiction(-held.side))  # type: ignore[operator]
    then = now._replace(sliding=xp.where(passes, other, now.sliding))
    share = before.w / xp.where(crossed, before.w - after.w, 1.0)
    still = stops | resting
    out = Crossing(crossed, stops, passes, still, share, 0.0 * share, now.M, after.w)
    # a joint that stops no longer pulls at others, which may stop with it
    turned = held.side * _beyond(out, dt)[0] < 0.0
    turned = turned & ~still & ~passes
    if bool(turned.any()):
        turned = turned & within(holding(then, still | turned), then)
        first = xp.min(xp.where(stops, share, 0.0 * share + 1.0), axis=-1)[..., None]
        stops, still = stops | turned, still | turned
        share = xp.where(turned, first, share)
    kick = constrained(now.M, now.sliding - then.sliding, still)
    if bool((resting | turned).any()):
        # the jump of friction, or of an acceleration that ends, may free a joint at rest
        Tf = holding(then, still)
        broken = still & ~within(Tf, then)
        Tf = xp.where(broken, Tf, then.sliding)
        freed = constrained(now.M, now.f - Tf, still & ~broken)
        kick = freed - constrained(now.M, now.f - now.sliding, still)
    return Crossing(crossed, stops, passes, still, share, kick, now.M, after.w)


def beyond(crossing: Crossing, before: State, after: State, dt: Array) -> State:
    """State behind a crossing.

    Joints that stop have w = 0 and the angle of the crossing, behind it friction would have pushed
    them back; they take any impulse, the others keep their momentum. Joints that pass have felt the
    friction of the other side since.
    """
    xp, at = namespace(after.w), crossing.rows
    span = xp.broadcast_to(dt, after.w.shape)[at]
    w, since = _beyond(crossing, span)
    stopped = before.q[at] + crossing.share * span / 2 * before.w[at]
    stopped = stopped + crossing.kick * since**2 / 2
    slid = after.q[at] + (w - crossing.w) * since / 2
    q_all, w_all = (1.0 * x for x in (after.q, after.w))
    q_all[at] = xp.where(crossing.stops, stopped, slid)
    w_all[at] = w
    return State(q_all, w_all, after.memory)


def _beyond(crossing: Crossing, dt: Array) -> tuple[Array, Array]:
    """Velocities (k, n) behind a crossing, and times (k, 1) since then."""
    xp = namespace(crossing.w)
    since = (1.0 - crossing.share) * dt
    since = xp.where(crossing.passes | crossing.stops, since, 0.0 * since)
    since = xp.max(since, axis=-1)[..., None]
    kept = constrained(crossing.M, times(crossing.M, crossing.w), crossing.still)
    kept = xp.where(crossing.stops.any(-1)[..., None], kept, crossing.w)
    return kept + crossing.kick * since, since


class Release(NamedTuple):
    """Joints that broke away within a substep, of the rows (...) that are true in `rows`.

    still (k, n): joints that stay at rest; kick (k, n) [rad/s^2]: by how much accelerations have
    grown at the end, from nothing; since (k, 1) [s]: for how long.
    """

    rows: Array
    still: Array
    kick: Array
    since: Array


def release(
    plant: Plant,
    friction: Friction,
    after: State,
    u: Array,
    held: Stiction,
    crossed: Crossing | None,
    dt: Array,
) -> Release | None:
    """Joints that were held, but under more than their break-away level at the end of dt."""
    if held.held is None:
        return None
    # where nothing moves, loads do not change
    xp, moves = namespace(after.w), after.w != 0.0
    some = (held.held & ~moves).any(-1) & moves.any(-1)
    if crossed is not None:
        some = some & ~crossed.rows
    if not bool(some.any()):
        return None
    dt = xp.broadcast_to(dt, (*some.shape, 1))
    if divisible(plant, friction, after, u) and not bool(some.all()):
        plant, friction, after, u, dt = rows(some, plant, friction, after, u, dt)
        held = held.take(some)
    else:
        some = xp.zeros_like(some) == xp.zeros_like(some)
    now = balance(plant, friction, after, u, held)
    Tf = holding(now, held.held)
    broken = held.held & ~within(Tf, now)
    if not bool(broken.any()):
        return None
    still = held.held & ~broken
    free = constrained(now.M, now.f - xp.where(broken, Tf, now.sliding), still)
    kick = free - constrained(now.M, now.f - now.sliding, held.held)
    n = broken.shape[-1]
    over = xp.stack([xp.abs(kick[..., j]) * now.M[..., j, j] for j in range(n)], axis=-1)
    share = over / xp.maximum(over + xp.maximum(held.margin, 0.0 * over), 0.0 * over + 1e-300)
    since = xp.max(xp.where(broken, share, 0.0 * share), axis=-1)[..., None] * dt
    return Release(some, still, kick, since)


def released(release: Release, after: State) -> State:
    """State behind a break-away: the load exceeded the level by a sum that grew with time."""
    at, since = release.rows, release.since
    q, w = 1.0 * after.q, 1.0 * after.w
    q[at] = q[at] + release.kick * since**2 / 6
    w[at] = w[at] + release.kick * since / 2
    return State(q, w, after.memory)
