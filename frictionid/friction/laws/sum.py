"""Sums of laws: a Stribeck peak and a gear that rubs the more under load, in one joint."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.per_joint import PARTS, Name, smoothed_part

_SHARED = "rad/s"  # unit of parameters that are the same in all laws; all others are factors


class _Own(NamedTuple):
    """A parameter of the sum: its name, unit, bounds, and its values in the law's starts."""

    name: str
    unit: str
    bounds: tuple[float, float]
    initial: tuple[float, ...]


@dataclass(frozen=True)
class Sum(Law):
    """Tf = sum of the torques of `laws`, static ones by name; what they share counts once.

    laws : their names, such as ["stribeck", "motor_load"]

    The parameters are those of all laws together. A term that several have, such as a Coulomb
    level, also by direction, is that of the first; a velocity that several have is the same.
    `loss` is the share of the motor torque that a gear swallows. Sums of such terms are the
    classical models of friction [Armstrong1994].

    >>> Sum(("stribeck", "motor_load")).names
    ('coulomb', 'peak', 'stribeck_velocity', 'viscous', 'loss')
    """

    laws: Annotated[tuple[Name, ...], Field(min_length=2)] = ("stribeck", "motor_load")
    width: float = 0.02
    shape: str = "tanh"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.laws:
            if PARTS[name].has_memory:
                raise InputError(f"sum: {name!r} has a memory: a sum is one of laws without")
        had: list[int] = []
        for name, places in zip(self.laws, self._places, strict=True):
            if set(places) <= {*had, None}:
                raise InputError(f"sum: {name!r} adds nothing to the laws before it: leave it out")
            had += [place for place in places if place is not None]

    @cached_property
    def parts(self) -> tuple[Law, ...]:
        """The laws, smoothed over `width`."""
        return tuple(smoothed_part(name, self.width, self.shape) for name in self.laws)

    @cached_property
    def _layout(self) -> tuple[list[_Own], list[list[int | None]]]:
        """Parameters of the sum; of each law the places of its own, None where they are zero."""
        own: list[_Own] = []
        places: list[list[int | None]] = []
        for law in self.parts:
            had = {_stem(p.name) for p in own}
            names = [p.name for p in own]
            here: list[int | None] = []
            for i, (name, unit) in enumerate(zip(law.names, law.units, strict=True)):
                if unit != _SHARED and _stem(name) in had:
                    here.append(None)
                elif name in names:
                    here.append(names.index(name))
                else:
                    here.append(len(own))
                    starts = tuple(start[i] for start in law.initial)
                    own.append(_Own(name, unit, law.bounds[i], starts))
            places.append(here)
        return own, places

    @property
    def _places(self) -> list[list[int | None]]:
        return self._layout[1]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self._layout[0])

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(p.unit for p in self._layout[0])

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return tuple(p.bounds for p in self._layout[0])

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        longest = max(len(law.initial) for law in self.parts)
        columns = [p.initial for p in self._layout[0]]
        return tuple(tuple(own[k % len(own)] for own in columns) for k in range(longest))

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether a law depends on the load."""
        return any(law.uses_load for law in self.parts)

    @property
    def is_linear(self) -> bool:  # type: ignore[override]
        """Whether all laws are linear in their parameters."""
        return all(law.is_linear for law in self.parts)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        first, *rest = (law.torque(own, x, ()) for law, own in self._each(theta))
        return sum(rest, start=first)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        first, *rest = (law.limit(own, x, ()) for law, own in self._each(theta))
        return sum(rest, start=first)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        columns: list[Array] = [0.0 * (theta[..., 0] + x.w)] * len(self.names)
        for (law, own), places in zip(self._each(theta), self._places, strict=True):
            slopes = law.gradient(own, x)
            for i, place in enumerate(places):
                if place is not None:
                    columns[place] = columns[place] + slopes[..., i]
        return namespace(theta, x.w).stack(columns, axis=-1)

    def _each(self, theta: Array) -> Iterator[tuple[Law, Array]]:
        """Each law with its parameters; torques that an earlier law has are zero."""
        zero, xp = 0.0 * theta[..., 0], namespace(theta)
        for law, places in zip(self.parts, self._places, strict=True):
            own = [zero if place is None else theta[..., place] for place in places]
            yield law, xp.stack(own, axis=-1)


def _stem(name: str) -> str:
    """Name of a torque, whatever the direction.

    >>> _stem("peak_negative"), _stem("viscous")
    ('peak', 'viscous')
    """
    return name.removesuffix("_positive").removesuffix("_negative")
