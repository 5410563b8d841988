"""A law around another, with the other's declared attributes and memory."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array
from frictionid.friction import Inputs, Law, Memory


@dataclass(frozen=True)
class WrappedLaw(Law):
    """A law around another, `law`, whose parameters and memory are the other's."""

    law: Law

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.law.names)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(self.law.units)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return tuple(self.law.bounds)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple(self.law.initial)

    @property
    def sample_time(self) -> float | None:  # type: ignore[override]
        """That of the other law."""
        return self.law.sample_time

    @property
    def longest_substep(self) -> float:  # type: ignore[override]
        """That of the other law."""
        return self.law.longest_substep

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether the other law does."""
        return self.law.uses_load

    @property
    def reads_window(self) -> bool:  # type: ignore[override]
        """Whether the other law does."""
        return self.law.reads_window

    @property
    def uses_temperature(self) -> bool:  # type: ignore[override]
        """Whether the other law does."""
        return self.law.uses_temperature

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.law.start(theta, x)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.law.advance(theta, x, memory, dt)

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array] | None:
        return self.law.relaxation(theta, x, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.law.limit(theta, x, memory)
