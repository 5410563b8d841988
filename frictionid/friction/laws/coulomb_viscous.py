"""Coulomb and viscous friction: Tf = Fc sgn(w) + Fv w."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL, by_direction, directions
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign


@dataclass(frozen=True)
class CoulombViscous(Law):
    """Tf = coulomb sgn(w) + viscous w, with sgn smoothed over `width` [rad/s].

    The physics step holds a joint at rest by itself; the width only has to be well below the
    velocities of interest [Olsson1998].
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "viscous")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 2

    def __post_init__(self) -> None:
        check_sign("coulomb_viscous", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] * smooth_sign(x.w, self.width, self.shape) + theta[..., 1] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = smooth_sign(x.w, self.width, self.shape)
        return xp.stack([sign + zero, x.w + zero], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] + 0.0 * x.w


@dataclass(frozen=True)
class AsymmetricCoulombViscous(Law):
    """Coulomb and viscous friction with a Coulomb level of its own in each direction.

    `coulomb_positive` holds for w > 0, `coulomb_negative` for w < 0; both are positive numbers.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb_positive", "coulomb_negative", "viscous")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 3

    def __post_init__(self) -> None:
        check_sign("coulomb_viscous", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return self.limit(theta, x, memory) * sign + theta[..., 2] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        zero = 0.0 * (theta[..., 0] + x.w)
        up, down = directions(x.w, smooth_sign(x.w, self.width, self.shape) + zero)
        return xp.stack([up, down, x.w + zero], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return by_direction(x.w, theta[..., 0], theta[..., 1])
