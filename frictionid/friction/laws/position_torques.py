"""Torques of the position beside friction, whatever the velocity: a motor's cogging, a spring.

    Cogging:  Tf = sum_k cos_k cos(k gear q) + sin_k sin(k gear q)
    Spring:   Tf = stiffness q + preload

Magnets and teeth pull towards some angles [Holtz1996]. A cable, a hose, a flexure or a balancing
spring pulls the joint towards where it is slack, at q = -preload/stiffness, as the springs of
joints in [MuJoCo2026]. This is no friction: it gives back what it takes, and a joint at rest has it
as well. Beside friction it is a part of a `sum`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, WrapValidator

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory

# harmonics that "auto" chooses among: with twelve coils and fourteen poles cogging has order 84
CANDIDATES = tuple(range(1, 97))
AUTO: Literal["auto"] = "auto"


def _or_auto(value: Any, check: Callable[[Any], Any]) -> Any:
    if value == AUTO:
        return value
    return check(tuple(value) if isinstance(value, list) else value)  # lists of TOML


if TYPE_CHECKING:
    Harmonics = tuple[int, ...] | Literal["auto"]
else:
    Harmonics = Annotated[tuple[Count, ...], Field(min_length=1), WrapValidator(_or_auto)]


class Periodic(Law):
    """A law with waves of the angle, cos(k gear q) and sin(k gear q) of its harmonics k.

    label : its name in what is wrong

    >>> import numpy as np
    >>> [float(wave[0]) for wave in Cogging((1, 2), 6.0).waves(np.zeros(1))]
    [1.0, 0.0, 1.0, 0.0]
    """

    harmonics: Harmonics
    gear: float
    label: ClassVar[str]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.orders)) < len(self.orders):
            raise InputError(f"{self.label}: harmonics = {list(self.orders)} must differ")

    @property
    def orders(self) -> tuple[int, ...]:
        """The harmonics, all candidates of "auto"."""
        return CANDIDATES if self.harmonics == AUTO else tuple(map(int, self.harmonics))

    @property
    def amplitudes(self) -> list[str]:
        """Names of the waves' factors."""
        return [f"{name}_{k}" for k in self.orders for name in ("cos", "sin")]

    def waves(self, q: Array) -> Iterator[Array]:
        """The waves (..., n) at angles."""
        xp = namespace(q)
        for k in self.orders:
            yield xp.cos(k * self.gear * q)
            yield xp.sin(k * self.gear * q)


@dataclass(frozen=True)
class Cogging(Periodic):
    """Tf = sum_k cos_k cos(k gear q) + sin_k sin(k gear q), a motor's cogging torque.

    The amplitudes `cos` and `sin` of each harmonic k are torques, the same in both directions and
    at rest, where they add to the load that friction holds. `harmonics` are the k of `gear` times
    the joint's angle; of "auto" least squares chooses those of 1 to 96 that the data show.
    Part of a sum: `laws = ["stribeck", { kind = "cogging", harmonics = [7] }]`.

    >>> Cogging((7,)).names
    ('cos_7', 'sin_7')
    """

    harmonics: Harmonics = (1,)
    gear: Positive = 1.0
    label = "cogging"

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        endless, names = -float("inf"), self.amplitudes
        return tuple(LawParameter(x, "N m", endless, size=0.1, optional=True) for x in names)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        terms = (theta[..., i] * wave for i, wave in enumerate(self.waves(x.q)))
        return sum(terms, start=0.0 * (theta[..., 0] + x.w))

    def gradient(self, theta: Array, x: Inputs) -> Array:
        none = 0.0 * (theta[..., 0] + x.w)
        return namespace(theta, x.w).stack([wave + none for wave in self.waves(x.q)], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return namespace(x.w).sign(x.w) * self.torque(theta, x, memory)


@dataclass(frozen=True)
class Spring(Law):
    """Tf = stiffness q + preload, of a cable or a spring.

    It is the same in both directions and at rest, where it adds to the load that friction holds.
    `stiffness` is what the torque grows by with the position. `preload` is the torque at position
    zero; a bias of the torque sensor looks like it.
    Part of a sum: `laws = ["coulomb_viscous", "spring"]`.

    >>> import numpy as np
    >>> from frictionid.friction import at_rest
    >>> x = at_rest(np.zeros(1))._replace(q=np.array([0.5]))
    >>> Spring().torque(np.array([[4.0, -1.0]]), x, ())
    array([1.])
    """

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        endless = -float("inf")
        return (
            LawParameter("stiffness", "N m/rad", endless, optional=True),
            LawParameter("preload", "N m", endless, optional=True),
        )

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] * x.q + theta[..., 1] + 0.0 * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        none = 0.0 * (theta[..., 0] + x.w)
        return namespace(theta, x.w).stack([x.q + none, 1.0 + none], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return namespace(x.w).sign(x.w) * self.torque(theta, x, memory)
