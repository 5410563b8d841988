"""No friction: the baseline of every comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array
from frictionid.friction import Inputs, Law, Memory


@dataclass(frozen=True)
class NoFriction(Law):
    """Tf = 0. It has no parameters: theta has shape (..., n, 0)."""

    names: ClassVar[tuple[str, ...]] = ()
    units: ClassVar[tuple[str, ...]] = ()
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ()

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * x.w + theta.sum(-1)  # the empty sum is zero and carries theta's batch axes

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return (0.0 * x.w)[..., None] + theta

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.torque(theta, x, ())
