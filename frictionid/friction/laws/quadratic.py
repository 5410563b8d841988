"""Coulomb and viscous friction, and a drag that grows with the velocity squared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign


@dataclass(frozen=True)
class Quadratic(Law):
    """Tf = coulomb sgn(w) + viscous w + drag w |w|, with sgn smoothed over `width` [rad/s].

    The drag is that of the air, or of oil that is churned; it may also stand for what the torque
    constant of a motor loses with its speed.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "viscous", "drag")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m s/rad", "N m s^2/rad^2")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 3

    def __post_init__(self) -> None:
        check_sign("quadratic", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        drag = theta[..., 2] * namespace(x.w).abs(x.w)
        return theta[..., 0] * sign + (theta[..., 1] + drag) * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = smooth_sign(x.w, self.width, self.shape)
        return xp.stack([sign + zero, x.w + zero, x.w * xp.abs(x.w) + zero], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] + 0.0 * x.w
