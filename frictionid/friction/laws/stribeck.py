"""Stribeck friction: break-away level that falls to the Coulomb level as sliding sets in.

Tf = (Fc + Fp exp(-(w/ws)^2)) sgn(w) + Fv w, break-away at Fc + Fp [Olsson1998].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import (
    LEVEL,
    VELOCITIES,
    VELOCITY,
    by_direction,
    directions,
    level,
    level_by_direction,
    stribeck_factor,
)
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign


@dataclass(frozen=True)
class Stribeck(Law):
    """Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2)) sgn(w) + viscous w.

    `peak` is the break-away minus the Coulomb level; sgn is smoothed over `width` [rad/s].
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "peak", "stribeck_velocity", "viscous")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m", "rad/s", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL, LEVEL, VELOCITY, LEVEL)
    # peak = 0 makes the first step of a fit the linear least squares at that Stribeck velocity
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, ws, 0.0) for ws in VELOCITIES
    )

    def __post_init__(self) -> None:
        check_sign("stribeck", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return level(theta, x.w) * sign + theta[..., 3] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        ws = theta[..., 2]
        left = stribeck_factor(x.w, ws)
        sign = smooth_sign(x.w, self.width, self.shape)
        by_ws = theta[..., 1] * sign * left * (2.0 * x.w**2 / ws**3)
        zero = 0.0 * by_ws
        return xp.stack([sign + zero, sign * left, by_ws, x.w + zero], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] + theta[..., 1] + 0.0 * x.w


@dataclass(frozen=True)
class AsymmetricStribeck(Law):
    """Stribeck friction with its own Coulomb level and peak in each direction.

    `_positive` levels hold for w > 0, `_negative` ones for w < 0; all are positive numbers.
    The Stribeck velocity and the viscous coefficient are shared.
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
    )
    units: ClassVar[tuple[str, ...]] = ("N m",) * 4 + ("rad/s", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 4 + (VELOCITY, LEVEL)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, 0.0, 0.0, ws, 0.0) for ws in VELOCITIES
    )

    def __post_init__(self) -> None:
        check_sign("stribeck", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return level_by_direction(theta, x.w, x.w) * sign + theta[..., 5] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        ws = theta[..., 4]
        up, down = directions(x.w, smooth_sign(x.w, self.width, self.shape))
        left = stribeck_factor(x.w, ws)
        by_ws = (theta[..., 2] * up + theta[..., 3] * down) * left * (2.0 * x.w**2 / ws**3)
        zero = 0.0 * by_ws
        columns = [up + zero, down + zero, up * left, down * left, by_ws, x.w + zero]
        return xp.stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        positive, negative = theta[..., 0] + theta[..., 2], theta[..., 1] + theta[..., 3]
        return by_direction(x.w, positive, negative)
