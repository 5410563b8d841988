"""A law with many numbers as one with few combinations of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Inputs, Memory
from frictionid.shooting.wrapped import Wrapped


@dataclass(frozen=True, eq=False, repr=False)
class Combined(Wrapped):
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
        memory: Memory = self.inner.start(self.numbers(theta), x)
        return memory

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.torque(self.numbers(theta), x, memory)

    def gradient(self, theta: Array, x: Inputs, memory: Memory = ()) -> Array:
        """Derivatives (K, n, r) of the torque at inputs (K, n)."""
        numbers = self.numbers(theta)
        own = self.inner.gradient(numbers, x, memory) if memory else self.inner.gradient(numbers, x)
        return np.swapaxes(np.swapaxes(own, 0, 1) @ self.directions, 0, 1)

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory]:
        """Derivatives of the torque at inputs (K, n): (K, n, r), and in each entry of memory."""
        own, by_memory = self.inner.slopes(self.numbers(theta), x, memory)
        return np.swapaxes(np.swapaxes(own, 0, 1) @ self.directions, 0, 1), by_memory

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        later: Memory = self.inner.advance(self.numbers(theta), x, memory, dt)
        return later

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.limit(self.numbers(theta), x, memory)
