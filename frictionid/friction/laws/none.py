"""No friction: the baseline of every comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array
from frictionid.friction import Inputs, Memory


@dataclass(frozen=True)
class NoFriction:
    """Tf = 0. It has no parameters: theta has shape (..., n, 0)."""

    names: ClassVar[tuple[str, ...]] = ()
    units: ClassVar[tuple[str, ...]] = ()
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ()
    initial: ClassVar[tuple[tuple[float, ...], ...]] = ((),)
    sample_time: ClassVar[float | None] = None
    uses_load: ClassVar[bool] = False

    def start(self, theta: Array, x: Inputs) -> Memory:
        return ()

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * x.w + theta.sum(-1)  # the empty sum is zero and carries theta's batch axes

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return (0.0 * x.w)[..., None] + theta

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return memory

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.torque(theta, x, ())
