"""Which joints stick at w = 0, where friction is a set and no function of the velocity.

A smoothed law cannot hold a joint at rest: it creeps under load, or chatters. So joints at rest
(w = 0 exactly) stick, as constraints, until their load exceeds the break-away level; loads of
joints that stick together follow from projected Gauss-Seidel. Under a law whose smoothing is wide,
slow joints are braked at least by the break-away level while their load is below it: they would
creep where law and load balance, at 1.5 widths under 0.9 of the level. Where the velocity of a
joint crosses zero, `zero_crossing` stops it, or lets it pass.
"""

from __future__ import annotations

from frictionid.arrays import Array, namespace
from frictionid.dynamics.sliding_friction import Stiction, braked, is_sharp
from frictionid.dynamics.state import Instant
from frictionid.dynamics.torque_balance import (
    Balance,
    balance,
    has_break_away,
    sticking_torque,
)

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
