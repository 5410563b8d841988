"""Friction of a gear that rubs the more, the more motor torque it transmits [Duclusaud2025]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.smooth_sign import smooth_sign


@dataclass(frozen=True)
class MotorLoad(Law):
    """Tf = (coulomb + loss |u|) sgn(w) + viscous w, with sgn smoothed over `width` [rad/s].

    `loss` is the share of the motor torque u that the gear swallows: it passes on 1 - loss of it
    while the motor drives, and holds back 1 + loss of it while it brakes. Without motor torque this
    is Coulomb and viscous friction. Where torque is fitted by Coulomb and viscous friction alone,
    the Coulomb level takes up the mean loss and is too high for motions with less torque.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "viscous", "loss")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m s/rad", "1")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, float("inf")),) * 2 + ((0.0, 1.0),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return self.limit(theta, x, memory) * sign + theta[..., 1] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = smooth_sign(x.w, self.width, self.shape) + zero
        return xp.stack([sign, x.w + zero, xp.abs(x.u) * sign], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] + theta[..., 2] * namespace(theta, x.u).abs(x.u) + 0.0 * x.w
