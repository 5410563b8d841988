"""Cogging: a periodic torque of a motor's position, whatever the velocity.

Tf = sum_k cos_k cos(k gear q) + sin_k sin(k gear q)

Magnets and teeth pull towards some angles [Holtz1996]. This is no friction: it gives back what it
takes, and a joint at rest has it as well. Beside friction it is a part of a `sum`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, WrapValidator

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory

CANDIDATES = tuple(range(1, 25))  # harmonics that "auto" chooses among
AUTO: Literal["auto"] = "auto"


def _or_auto(value: Any, check: Callable[[Any], Any]) -> Any:
    if value == AUTO:
        return value
    return check(tuple(value) if isinstance(value, list) else value)  # lists of TOML


if TYPE_CHECKING:
    Harmonics = tuple[int, ...] | Literal["auto"]
else:
    Harmonics = Annotated[tuple[Count, ...], Field(min_length=1), WrapValidator(_or_auto)]


def orders(harmonics: Harmonics, law: str) -> tuple[int, ...]:
    """The harmonics themselves, which must differ; all candidates of "auto".

    >>> orders((7, 14), "cogging")
    (7, 14)
    """
    if harmonics == AUTO:
        return CANDIDATES
    if len(set(harmonics)) < len(harmonics):
        raise InputError(f"{law}: harmonics = {list(harmonics)} must differ")
    return tuple(map(int, harmonics))


def waves(q: Array, harmonics: Sequence[int], gear: float) -> Iterator[Array]:
    """cos(k gear q) and sin(k gear q) of each harmonic k.

    >>> import numpy as np
    >>> [float(wave[0]) for wave in waves(np.zeros(1), (1, 2), 6.0)]
    [1.0, 0.0, 1.0, 0.0]
    """
    xp = namespace(q)
    for k in harmonics:
        yield xp.cos(k * gear * q)
        yield xp.sin(k * gear * q)


@dataclass(frozen=True)
class Cogging(Law):
    """Tf = sum_k cos_k cos(k gear q) + sin_k sin(k gear q), a motor's cogging torque.

    The amplitudes `cos` and `sin` of each harmonic k are torques, the same in both directions and
    at rest, where they add to the load that friction holds. `harmonics` are the k of `gear` times
    the joint's angle; of "auto" least squares chooses those of 1 to 24 that the data show.
    Part of a sum: `laws = ["stribeck", { kind = "cogging", harmonics = [7] }]`.

    >>> Cogging((7,)).names
    ('cos_7', 'sin_7')
    """

    harmonics: Harmonics = (1,)
    gear: Positive = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        orders(self.harmonics, "cogging")

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        names = (f"{name}_{k}" for k in self.orders for name in ("cos", "sin"))
        endless = -float("inf")
        return tuple(LawParameter(x, "N m", endless, size=0.1, optional=True) for x in names)

    @property
    def orders(self) -> tuple[int, ...]:
        """The harmonics, all candidates of "auto"."""
        return orders(self.harmonics, "cogging")

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        terms = (theta[..., i] * wave for i, wave in enumerate(self._waves(x)))
        return sum(terms, start=0.0 * (theta[..., 0] + x.w))

    def gradient(self, theta: Array, x: Inputs) -> Array:
        none = 0.0 * (theta[..., 0] + x.w)
        return namespace(theta, x.w).stack([wave + none for wave in self._waves(x)], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return namespace(x.w).sign(x.w) * self.torque(theta, x, memory)

    def _waves(self, x: Inputs) -> Iterator[Array]:
        return waves(x.q, self.orders, self.gear)
