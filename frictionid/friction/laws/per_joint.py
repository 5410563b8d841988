"""A law of its own for each joint: shoulders with a Stribeck peak, wrists without, and so on.

Tf_j = law_j(q_j, w_j, u_j, load_j)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.coulomb_viscous import CoulombViscous, NoFriction, Quadratic
from frictionid.friction.laws.dahl import Dahl
from frictionid.friction.laws.film_lag import FilmLag
from frictionid.friction.laws.load_dependent import LoadDependent
from frictionid.friction.laws.lugre import LuGre
from frictionid.friction.laws.motor_load import MotorLoad
from frictionid.friction.laws.stribeck import Stribeck

Name = Literal[
    "none",
    "coulomb_viscous",
    "coulomb_viscous_asymmetric",
    "stribeck",
    "stribeck_asymmetric",
    "quadratic",
    "load_dependent",
    "load_dependent_stribeck",
    "motor_load",
    "motor_load_quadratic",
    "film_lag",
    "film_lag_asymmetric",
    "dahl",
    "dahl_motor_load",
    "lugre",
    "lugre_asymmetric",
]
PARTS: dict[Name, Law] = {
    "none": NoFriction(),
    "coulomb_viscous": CoulombViscous(),
    "coulomb_viscous_asymmetric": CoulombViscous(symmetric=False),
    "stribeck": Stribeck(),
    "stribeck_asymmetric": Stribeck(symmetric=False),
    "quadratic": Quadratic(),
    "load_dependent": LoadDependent(),
    "load_dependent_stribeck": LoadDependent(stribeck=True),
    "motor_load": MotorLoad(),
    "motor_load_quadratic": MotorLoad(squared=True),
    "film_lag": FilmLag(),
    "film_lag_asymmetric": FilmLag(symmetric=False),
    "dahl": Dahl(),
    "dahl_motor_load": Dahl(motor_load=True),
    "lugre": LuGre(),
    "lugre_asymmetric": LuGre(symmetric=False),
}


def smoothed_part(name: Name, width: float, shape: str = "") -> Law:
    """The law of a name, smoothed over a width where it smooths sgn(w) at all."""
    law = PARTS[name]
    if not law.width:
        return law
    settings: dict[str, Any] = {"width": width, "shape": shape or law.shape}
    return replace(law, **settings)


class _Part(NamedTuple):
    """One joint's law with its parameters, inputs and memory, the joint's axis of length one."""

    law: Law
    theta: Array
    x: Inputs
    memory: Memory


@dataclass(frozen=True)
class PerJoint(Law):
    """The laws of the joints by name, in their order.

    laws : name of each joint's law, or one name for all joints

    The parameters are those of all laws together; what a joint's law does not have stays zero.

    >>> law = PerJoint(("stribeck", "coulomb_viscous"))
    >>> law.names
    ('coulomb', 'peak', 'stribeck_velocity', 'viscous')
    >>> law.has_parameters(2).tolist()
    [[True, True, True, True], [True, False, False, True]]
    """

    laws: Annotated[tuple[Name, ...], Field(min_length=1)] = ("coulomb_viscous",)
    width: float = 0.02
    shape: str = "tanh"

    @cached_property
    def parts(self) -> tuple[Law, ...]:
        """The law of each joint, smoothed over `width` where it smooths sgn(w)."""
        return tuple(smoothed_part(name, self.width) for name in self.laws)

    @cached_property
    def _first(self) -> dict[str, tuple[Law, int]]:
        """Where each parameter's name stands first: a law, and its place there."""
        out: dict[str, tuple[Law, int]] = {}
        for law in self.parts:
            for i, name in enumerate(law.names):
                out.setdefault(name, (law, i))
        return out

    @cached_property
    def _places(self) -> tuple[list[int], ...]:
        """Places of each joint's parameters among all."""
        names = self.names
        return tuple([names.index(name) for name in law.names] for law in self.parts)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._first)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(law.units[i] for law, i in self._first.values())

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return tuple(law.bounds[i] for law, i in self._first.values())

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        longest = max(len(law.initial) for law in self.parts)
        return tuple(
            tuple(law.initial[k % len(law.initial)][i] for law, i in self._first.values())
            for k in range(longest)
        )

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether a joint's friction depends on its load."""
        return any(law.uses_load for law in self.parts)

    @property
    def has_gradient(self) -> bool:
        return all(law.has_gradient for law in self.parts) and not self.has_memory

    @property
    def has_memory(self) -> bool:
        return any(law.has_memory for law in self.parts)

    def has_parameters(self, joints: int) -> NDArray[np.bool_]:
        if len(self.laws) == 1:
            return np.ones((joints, len(self.names)), dtype=bool)
        if joints != len(self.laws):
            raise InputError(
                f"per_joint: {len(self.laws)} laws for {joints} joint{'s' if joints > 1 else ''}; "
                "give one for each"
            )
        out = np.zeros((joints, len(self.names)), dtype=bool)
        for j, own in enumerate(self._places):
            out[j, own] = True
        return out

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._joined(
            p.law.torque(p.theta, p.x, p.memory) for p in self._each(theta, x, memory)
        )

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._joined(
            p.law.limit(p.theta, p.x, p.memory) for p in self._each(theta, x, memory)
        )

    def gradient(self, theta: Array, x: Inputs) -> Array:
        columns = []
        for part, places in zip(self._each(theta, x, ()), self._places, strict=True):
            own = np.asarray(part.law.gradient(part.theta, part.x))
            wide = np.zeros((*own.shape[:-1], len(self.names)))
            wide[..., places] = own
            columns.append(wide)
        return np.concatenate(np.broadcast_arrays(*columns), axis=-2)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self._packed([p.law.start(p.theta, p.x) for p in self._each(theta, x, ())])

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        parts = self._each(theta, x, memory)
        return self._packed([p.law.advance(p.theta, p.x, p.memory, dt) for p in parts])

    @cached_property
    def _entries(self) -> tuple[int, ...]:
        """Number of each joint's entries of memory."""
        zero = Inputs(*(np.zeros((1, 1)) for _ in range(4)))
        return tuple(len(law.start(np.array(law.initial[:1]), zero)) for law in self.parts)

    def _each(self, theta: Array, x: Inputs, memory: Memory) -> Iterator[_Part]:
        for j, (law, places) in enumerate(zip(self.parts, self._places, strict=True)):
            one = slice(j, j + 1) if len(self.laws) > 1 else slice(None)
            own = memory[: self._entries[j]] if memory else ()
            yield _Part(
                law,
                theta[..., one, :][..., places],
                x.each(lambda entry, one=one: entry[..., one]),
                tuple(entry[..., one] for entry in own),
            )

    def _joined(self, columns: Iterator[Array]) -> Array:
        arrays = np.broadcast_arrays(*columns)
        joined: Array = namespace(*arrays).concat(arrays, axis=-1)
        return joined

    def _packed(self, memories: list[Memory]) -> Memory:
        """Memories of the joints as entries for all, zero where a joint has fewer."""
        most = max(self._entries)
        if not most:
            return ()
        like = next(own[0] for own in memories if own)
        filled = [(*own, *(0.0 * like for _ in range(most - len(own)))) for own in memories]
        return tuple(self._joined(iter(entries)) for entries in zip(*filled, strict=True))
