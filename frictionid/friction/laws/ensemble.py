"""The mean of networks of one form [Lakshminarayanan2017]."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any

from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.friction import Friction, Inputs, Law, LawParameter, Memory

from .mlp import MLP


@dataclass(frozen=True)
class Ensemble(Law):
    """Tf = mean of the torques of `members` frictions of the law `base`, each with its own theta.

    width, shape : smoothing of sgn(w) of all of them [rad/s]
    """

    base: Law = MLP()
    members: Annotated[int, Field(ge=2)] = 2
    width: float = 0.02
    shape: str = "tanh"
    is_network = True

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        each = ((k, p) for k in range(self.members) for p in self.base.parameters)
        return tuple(p._replace(name=f"{p.name}.{k}") for k, p in each)

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(start) * self.members for start in self.base.initial)

    @property
    def sample_time(self) -> float | None:  # type: ignore[override]
        """That of the base."""
        return self.base.sample_time

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether the base does."""
        return self.base.uses_load

    def start(self, theta: Array, x: Inputs) -> Memory:
        parts = _split(theta, self.members)
        return tuple(entry for part in parts for entry in self.base.start(part, x))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        total: Any = sum(self.member.torque(part, x, z) for part, z in self._each(theta, memory))
        return total / self.members

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        parts = self._each(theta, memory)
        return tuple(entry for part, z in parts for entry in self.base.advance(part, x, z, dt))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        total: Any = sum(self.member.limit(part, x, z) for part, z in self._each(theta, memory))
        return total / self.members

    @cached_property
    def member(self) -> Law:
        """The law of each member, smoothed alike."""
        names = {f.name for f in fields(self.base)} & {"width", "shape"}
        return replace(self.base, **{name: getattr(self, name) for name in names})

    def _each(self, theta: Array, memory: Memory) -> Iterator[tuple[Array, Memory]]:
        """Parameters and memory of each member."""
        size = len(memory) // self.members
        for k, part in enumerate(_split(theta, self.members)):
            yield part, memory[k * size : (k + 1) * size]


def _split(theta: Array, members: int) -> list[Array]:
    """Parameters of each member."""
    size = theta.shape[-1] // members
    return [theta[..., k * size : (k + 1) * size] for k in range(members)]


def together(law: Any, thetas: Sequence[Array]) -> Friction:
    """Friction that is the mean of those with parameters (..., n, P); of one, that itself."""
    if len(thetas) == 1:
        return Friction(law, thetas[0])
    ensemble = Ensemble(law, len(thetas), law.width, law.shape or Ensemble.shape)
    return Friction(ensemble, namespace(*thetas).concat(list(thetas), axis=-1))
