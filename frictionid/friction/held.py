"""Friction while its memory stands still, as that of samples does from one to the next.

It is then friction without memory, whose numbers are its parameters and what it remembers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from frictionid.arrays import Array, namespace
from frictionid.friction.law import Inputs, Law, Memory


@dataclass(frozen=True)
class HeldLaw(Law):
    """A law whose memory, of so many `entries`, stands still: its last parameters are these.

    width, shape : smoothing of sgn(w) of the law [rad/s]
    """

    law: Law
    entries: int
    width: float = 0.0
    shape: str = "tanh"

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.law.names, *(f"memory_{i}" for i in range(self.entries)))

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.law.units, *("",) * self.entries)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.law.bounds, *((-float("inf"), float("inf")),) * self.entries)

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether the law does."""
        return self.law.uses_load

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        own, held = self._parts(theta)
        return self._law.torque(own, x, held)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        own, held = self._parts(theta)
        return self._law.limit(own, x, held)

    @cached_property
    def _law(self) -> Law:
        return self.law if self.width == self.law.width else self.law.with_width(self.width)

    def _parts(self, theta: Array) -> tuple[Array, Memory]:
        first = theta.shape[-1] - self.entries
        return theta[..., :first], tuple(theta[..., first + i] for i in range(self.entries))


def held(law: Law, theta: Array, memory: Memory) -> tuple[Law, Array]:
    """A law without memory, and its theta, that is as another one while its memory stands still.

    >>> import numpy as np
    >>> from frictionid.friction import at_rest
    >>> from frictionid.friction.laws import WindowMLP
    >>> law, x = WindowMLP(), at_rest(np.array([0.3]))
    >>> theta = np.array(law.initial)
    >>> memory = law.start(theta, at_rest(np.array([0.1])))
    >>> still, numbers = held(law, theta, memory)
    >>> bool((still.torque(numbers, x, ()) == law.torque(theta, x, memory)).all())
    True
    """
    own = law.while_held(theta, memory)
    if own is not None:
        return own
    xp = namespace(theta)
    shape = (*memory[0].shape, theta.shape[-1])
    whole = [xp.broadcast_to(theta, shape), *(entry[..., None] for entry in memory)]
    return HeldLaw(law, len(memory), law.width, law.shape), xp.concat(whole, axis=-1)
