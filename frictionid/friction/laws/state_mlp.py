"""A network of all that is measured: acceleration without physics [Narendra1990]."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array
from frictionid.config import Count
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import Hidden, outputs
from frictionid.friction.laws.network_law import Features, NetworkLaw, Scale
from frictionid.friction.laws.state_library import (
    SCALES,
    state_features,
    width_of,
)


@dataclass(frozen=True)
class StateMLP(NetworkLaw):
    """Tf = -acceleration f(q, w, u of all joints), f a network with `hidden` tanh units.

    joints : whose state it sees
    turning : whether the joints turn, or slide
    width : of the smooth sign of w that is one of its inputs [rad/s]
    """

    joints: Count = 2
    hidden: Hidden = (32, 32)
    turning: bool = True
    width: float = 0.1
    shape = ""  # of an input, not of friction

    @property
    def scales(self) -> tuple[Scale, ...]:
        return SCALES

    @property
    def sizes(self) -> tuple[int, ...]:
        return (width_of(self.joints, self.turning), *self.hidden, 1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        z = state_features(theta, x, self.joints, self.turning, self.width)
        zero = 0.0 * z[..., 0]
        return Features(z, zero, zero - 1.0)

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Acceleration (..., n) [rad/s^2]."""
        return theta[..., 0] * outputs(theta[..., 3:], z, self.sizes)[..., 0]
