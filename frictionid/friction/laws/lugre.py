"""LuGre friction: bristles that bend before a joint slips, and then slide at the Stribeck level.

dz/dt = w - s0 |w| z / g(w),   Tf = s0 z + s1(w) dz/dt + Fv w   [CanudasDeWit1995], [Olsson1998]
g(w) = Fc + Fp exp(-(w/ws)^2)

With a constant s1 this can drive. Here s1(w) = damping exp(-(w/damping_velocity)^2), and never more
than 4 g(w)/|w|, nor than 4 g(w)/width: with x = s0 z, what friction takes less what the bristles
store is

w Tf - d(s0 z^2/2)/dt = |w| x^2/g + (s1 |w|/g) x dz/dt + s1 (dz/dt)^2 + Fv w^2

and s1 |w| <= 4 g is what makes this quadratic form positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.bristle import bristle_state, rate
from frictionid.friction.laws.dahl import PRESLIDING, PRESLIDINGS
from frictionid.friction.laws.levels import (
    LEVEL,
    VELOCITY,
    level,
    level_by_direction,
    stribeck_factor,
)
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign

_FADING = (0.01, 10.0)  # [rad/s]
_FADES = 0.1
_STARTS = tuple((ws, z) for z in PRESLIDINGS for ws in (0.5, 1.2, 3.0, 8.0, 20.0))
_TINY = 1e-12  # no division by zero where there is no friction, or no motion


@dataclass(frozen=True)
class LuGre(Law):
    """Stribeck friction of bristles that bend by `presliding` [rad] before a joint breaks away.

    Their stiffness is s0 = (coulomb + peak) / presliding [N m/rad], so that Stribeck friction is
    the limit of small `presliding`. Memory is their bend z [rad]. It starts as in steady sliding;
    of a joint at rest the bend is not known, and is taken to grow over `width` [rad/s]. At rest the
    bristles hold the joint, there is no break-away level.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = (
        "coulomb",
        "peak",
        "stribeck_velocity",
        "viscous",
        "presliding",
        "damping",
        "damping_velocity",
    )
    units: ClassVar[tuple[str, ...]] = (
        *("N m", "N m", "rad/s", "N m s/rad"),
        *("rad", "N m s/rad", "rad/s"),
    )
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (
        *(LEVEL, LEVEL, VELOCITY, LEVEL),
        *(PRESLIDING, LEVEL, _FADING),
    )
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, ws, 0.0, z, 0.0, _FADES) for ws, z in _STARTS
    )

    def __post_init__(self) -> None:
        check_sign("lugre", self.width, self.shape)

    def start(self, theta: Array, x: Inputs) -> Memory:
        bend = _bend(theta[..., 4], *_levels(theta, x.w))
        return (bend * smooth_sign(x.w, self.width, self.shape),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return _torque(theta[..., 3:], x.w, memory[0], *_levels(theta, x.w), self.width)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        bend = _bend(theta[..., 4], *_levels(theta, x.w))
        return (bristle_state(memory[0], x.w, bend, dt),)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)


@dataclass(frozen=True)
class AsymmetricLuGre(Law):
    """LuGre friction with its own Coulomb level and peak in each direction.

    The bristles are the same both ways: `presliding` is their bend [rad] under the mean of the two
    break-away levels, so that s0 = (their mean) / presliding.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = (
        "coulomb_positive",
        "coulomb_negative",
        "peak_positive",
        "peak_negative",
        "stribeck_velocity",
        "viscous",
        "presliding",
        "damping",
        "damping_velocity",
    )
    units: ClassVar[tuple[str, ...]] = (
        *("N m", "N m", "N m", "N m", "rad/s", "N m s/rad"),
        *("rad", "N m s/rad", "rad/s"),
    )
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (
        *(LEVEL, LEVEL, LEVEL, LEVEL, VELOCITY, LEVEL),
        *(PRESLIDING, LEVEL, _FADING),
    )
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, 0.0, 0.0, ws, 0.0, z, 0.0, _FADES) for ws, z in _STARTS
    )

    def __post_init__(self) -> None:
        check_sign("lugre", self.width, self.shape)

    def start(self, theta: Array, x: Inputs) -> Memory:
        bend = _bend(theta[..., 6], *_sided_levels(theta, x.w))
        return (bend * smooth_sign(x.w, self.width, self.shape),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return _torque(theta[..., 5:], x.w, memory[0], *_sided_levels(theta, x.w), self.width)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        bend = _bend(theta[..., 6], *_sided_levels(theta, x.w))
        return (bristle_state(memory[0], x.w, bend, dt),)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)


def _levels(theta: Array, w: Array) -> tuple[Array, Array]:
    """Level at w, and the one that bends the bristles by `presliding` [N m]."""
    return level(theta, w), theta[..., 0] + theta[..., 1]


def _sided_levels(theta: Array, w: Array) -> tuple[Array, Array]:
    both = theta[..., 0] + theta[..., 1] + theta[..., 2] + theta[..., 3]
    return level_by_direction(theta, w, w), both / 2


def _bend(presliding: Array, here: Array, top: Array) -> Array:
    """Bend in steady sliding at the level `here` [rad], > 0; the share of no friction is one."""
    xp = namespace(here, top)
    share = here / xp.where(top == 0, xp.ones_like(top), top)
    share = xp.where(top == 0, xp.ones_like(share), share)
    return presliding * xp.maximum(share, _TINY + 0.0 * share)


def _torque(theta: Array, w: Array, z: Array, here: Array, top: Array, slow: float) -> Array:
    """Torque [N m]; theta holds viscous, presliding, damping, damping_velocity.

    Below `slow` [rad/s] the damping's limit grows no further: a law without one is too steep to be
    resolved, and data that do not tell the damping would lead there.
    """
    xp = namespace(theta, w)
    fading = theta[..., 2] * stribeck_factor(w, theta[..., 3])
    damping = xp.minimum(fading, 4.0 * here / xp.maximum(xp.abs(w), slow + 0.0 * w))
    bending = rate(z, w, _bend(theta[..., 1], here, top))
    return top / theta[..., 1] * z + damping * bending + theta[..., 0] * w
