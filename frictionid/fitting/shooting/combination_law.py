"""A law with many numbers as one with few combinations of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.dynamics.tangent.smoothed_law import SmoothedLaw
from frictionid.friction import Inputs, Memory


@dataclass(frozen=True, eq=False, repr=False)
class CombinationLaw(SmoothedLaw):
    """A law of the numbers origin + directions theta, theta (n, r).

    origin : (n, P); directions : (n, P, r)
    """

    origin: Array
    directions: Array

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"combination {k + 1}" for k in range(self.directions.shape[-1]))

    @property
    def units(self) -> tuple[str, ...]:
        return ("1",) * self.directions.shape[-1]

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return ((-float("inf"), float("inf")),) * self.directions.shape[-1]

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((0.0,) * self.directions.shape[-1],)

    def numbers(self, theta: Array) -> Array:
        """The law's own numbers (..., n, P)."""
        return self.origin + (self.directions @ np.asarray(theta)[..., None])[..., 0]

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.inner.start(self.numbers(theta), x)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.torque(self.numbers(theta), x, memory)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return self._combined(self.inner.gradient(self.numbers(theta), x))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory] | None:
        known = self.inner.slopes(self.numbers(theta), x, memory)
        return None if known is None else (self._combined(known[0]), known[1])

    def _combined(self, gradient: Array) -> Array:
        """Derivatives (K, n, r) in the combinations, of those (K, n, P) in the law's numbers."""
        return np.swapaxes(np.swapaxes(gradient, 0, 1) @ self.directions, 0, 1)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.inner.advance(self.numbers(theta), x, memory, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.limit(self.numbers(theta), x, memory)
