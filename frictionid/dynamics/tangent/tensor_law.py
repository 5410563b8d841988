"""A law of tensors on NumPy arrays, its derivatives by reverse mode.

Nothing here names torch: tensors bring along what is needed, on whatever device they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.wrapped import WrappedLaw


@dataclass(frozen=True, eq=False, repr=False)
class SmoothedLaw(WrappedLaw):
    """A law around another, with the other's smoothing at rest, of `width` and `shape`."""

    width: float = field()  # without the default of `Law`
    shape: str = field()

    def __post_init__(self) -> None:
        """The other law has checked its smoothing."""

    def __repr__(self) -> str:
        return repr(self.law)

    @property
    def inner(self) -> Law:
        """The other law, with the smoothing that is asked for."""
        same = self.width == self.law.width
        return self.law if same else self.law.with_width(self.width)


_ROOM = 4_000_000  # numbers of rows' own parameters at a time


@dataclass(frozen=True, eq=False, repr=False)
class TensorLaw(SmoothedLaw):
    """A law that computes with tensors like a given one, NumPy outside."""

    like: Array

    def start(self, theta: Array, x: Inputs) -> Memory:
        return tuple(map(_numpy, self.inner.start(self._in(theta), x.each(self._in))))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        inner = x.each(self._in)
        return _numpy(self.inner.torque(self._in(theta), inner, self._all(memory)))

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        inner, z = x.each(self._in), self._all(memory)
        return tuple(map(_numpy, self.inner.advance(self._in(theta), inner, z, self._in(dt))))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        inner = x.each(self._in)
        return _numpy(self.inner.limit(self._in(theta), inner, self._all(memory)))

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return self.gradient_along(theta, (x,), (), np.zeros((len(x.w), 1)))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory]:
        zero = np.zeros((len(x.w), 1))
        parts = [self._back(theta, (x,), memory, zero, rows) for rows in self._rows(theta, zero)]
        by_memory = zip(*(part[1] for part in parts), strict=True)
        return np.concatenate([part[0] for part in parts]), tuple(map(np.concatenate, by_memory))

    def gradient_along(
        self, theta: Array, path: Sequence[Inputs], memory: Memory, dt: Array
    ) -> Array:
        """Derivatives (K, n, P) of the torque at the end of K short paths.

        path : inputs (K, n) at each sample, of which the first finds the memory (K, n) as given
        dt : (K, 1) [s] between the samples
        """
        parts = self._rows(theta, dt)
        return np.concatenate([self._back(theta, path, memory, dt, rows)[0] for rows in parts])

    def _rows(self, theta: Array, dt: Array) -> list[slice]:
        most = max(1, _ROOM // int(np.prod(theta.shape)))
        return [slice(i, i + most) for i in range(0, len(dt), most)]

    def _back(
        self, theta: Array, path: Sequence[Inputs], memory: Memory, dt: Array, rows: slice
    ) -> tuple[Array, Memory]:
        span = self._in(dt[rows])
        # numbers of its own for every row: one pass back then gives the derivatives of all rows
        leaf = self._in(np.broadcast_to(theta, (len(dt[rows]), *theta.shape))).requires_grad_()
        first = tuple(z.requires_grad_() for z in self._all([entry[rows] for entry in memory]))
        z = first
        inner = [x.each(lambda value: self._in(value[rows])) for x in path]
        for x in inner[1:]:
            z = self.inner.advance(leaf, x, z, span)
        self.inner.torque(leaf, inner[-1], z).sum().backward()
        # an entry that the torque does not read has no derivative
        none = np.zeros_like(path[0].w[rows])
        by_memory = tuple(none if z.grad is None else _numpy(z.grad) for z in first)
        return _numpy(leaf.grad), by_memory

    def _all(self, values: Sequence[Array]) -> tuple[Any, ...]:
        return tuple(self._in(value) for value in values)

    def _in(self, x: Array) -> Any:
        xp = namespace(self.like)
        return xp.asarray(np.array(x, dtype=float), device=self.like.device)


def _numpy(x: Any) -> Array:
    return x.detach().cpu().numpy()
