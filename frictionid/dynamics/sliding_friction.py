"""Friction of joints whose sliding direction is known, whatever the smoothing of the law.

A law smoothed at w = 0 stands for a step there. In a substep a joint slides in one direction, so
that the law is evaluated on that side of its smoothing: at the joint's speed or the least one at
which the smoothing does not show.
"""

from __future__ import annotations

from typing import NamedTuple

from frictionid.arrays import Array, namespace
from frictionid.friction import Friction, Inputs, Law, Memory
from frictionid.friction.law import NUMERICAL_WIDTH, SHARP_WIDTH

_WIDTHS = 5.0  # of a law's smoothing: beyond them it does not show


class Stiction(NamedTuple):
    """What friction does in a substep beyond the smooth law.

    direction : (..., n), sign of the velocity with which a joint slides; None where the law has no
        break-away level, and is left as it is
    sticking : (..., n), joints that are held at rest
    braking : (..., n) [N m], minimum braking torque with the sign of the velocity, zero for joints
        that are left to the law; None for sharp laws
    firm : (..., n), sticking joints that are far from break-away
    margin : (..., n) [N m], break-away margin of joints at rest: break-away level less the load

    All but `direction` are None where no joint is slow.
    """

    direction: Array | None
    sticking: Array | None = None
    braking: Array | None = None
    firm: Array | None = None
    margin: Array | None = None

    def rows(self, which: Array) -> Stiction:
        """That of some rows."""
        return Stiction(*(None if x is None else x[which] for x in self))


def friction_torque(
    friction: Friction, x: Inputs, memory: Memory, stiction: Stiction | None
) -> Array:
    """Friction torque (..., n) [N m] of sliding joints; None: of the smooth law."""
    if stiction is None:
        return friction.torque(x, memory)
    w = sliding_velocity(friction, x.w, stiction)
    law = sharpened(friction, stiction)
    return braked(law.torque(friction.theta, x._replace(w=w), memory), stiction)


def sliding_velocity(friction: Friction, w: Array, stiction: Stiction) -> Array:
    """Velocities (..., n) at which the law is evaluated: beyond its smoothing, in the direction."""
    least = least_sliding_speed(friction)
    if stiction.direction is None or least == 0.0:
        return w
    xp, direction = namespace(w), stiction.direction
    beyond = direction * xp.maximum(direction * w, 0.0 * w + least)
    return xp.where(direction == 0.0, w, beyond)


def least_sliding_speed(friction: Friction) -> float:
    """Speed [rad/s] beyond which the law of a sliding joint is evaluated; 0: at any speed."""
    return 4.0 * _WIDTHS * SHARP_WIDTH if is_sharp(friction) else _smoothing(friction)


def _smoothing(friction: Friction) -> float:
    """Speed [rad/s] below which a law's smoothing shows; 0 where it is wide on purpose."""
    return _WIDTHS * friction.law.width if friction.law.width <= NUMERICAL_WIDTH else 0.0


def is_sharp(friction: Friction) -> bool:
    """Whether a law's smoothing only stands for a sharp step at w = 0, and is no part of physics.

    So is a narrow tanh; an arctangent shows at all speeds.
    """
    return friction.law.shape == "tanh" and _smoothing(friction) > 0.0


def sharpened(friction: Friction, stiction: Stiction) -> Law:
    """The law without smoothing, for joints that slide in a direction."""
    return friction.law if stiction.direction is None else friction.law.sharpened()


def braked(Tf: Array, stiction: Stiction) -> Array:
    """Friction torque (..., n) [N m], no less than the minimum braking torque."""
    least = stiction.braking
    if least is None:
        return Tf
    xp = namespace(Tf)
    at_least = xp.where(least < 0, xp.minimum(Tf, least), Tf)
    return xp.where(least > 0, xp.maximum(Tf, least), at_least)
