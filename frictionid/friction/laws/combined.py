"""Laws made of other laws: one for each joint, and sums of several in one joint."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.config import unknown
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory, at_rest

from .levels import NoFriction, stem
from .load import LoadDependent, MotorLoad
from .position_torques import Cogging, Spring
from .relaxing import Dahl, FilmLag, LuGre
from .stribeck import CoulombViscous, Quadratic, Stribeck

# Laws that others can be made of.
PARTS: Mapping[str, type[Law]] = {
    law.kind: law
    for law in (
        *(NoFriction, CoulombViscous, Stribeck, Quadratic, LoadDependent, MotorLoad),
        *(FilmLag, Dahl, LuGre, Cogging, Spring),
    )
}


def part_of(part: Any, where: str, kinds: Sequence[str] = tuple(PARTS)) -> Law:
    """A law of one of these kinds; `where` it stands begins every complaint.

    given : its name, a table of its name as `kind` and of its settings, or the law itself

    Raises
    ------
    InputError
        For other laws and settings.

    >>> part_of({"kind": "stribeck", "symmetric": False}, "sum: laws")
    Stribeck(width=0.02, shape='tanh', symmetric=False)
    """
    settings = dict(part) if isinstance(part, Mapping) else {"kind": part}
    kind = settings.pop("kind", None)
    if isinstance(part, Law):
        kind = next((name for name in kinds if PARTS[name] is type(part)), part)
    if kind not in kinds:
        words = f"{', '.join(map(repr, kinds[:-1]))} or {kinds[-1]!r}"
        raise InputError(f"{where}: it should be {words}, not {kind!r}")
    if isinstance(part, Law):
        return part
    names = [field.name for field in fields(PARTS[kind])]
    for name in settings:
        if name not in names:
            raise InputError(f"{where}: {kind}: {unknown(name, names)}")
    return PARTS[kind](**settings)


class CombinedLaw(Law):
    """A law made of others, its `parts`, which are smoothed alike.

    made_of : fields that hold them: a law each, by its name, as a table or as it is, or several
    kinds : of laws that it can be made of
    """

    made_of: ClassVar[tuple[str, ...]] = ("law",)
    kinds: ClassVar[tuple[str, ...]] = tuple(PARTS)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.made_of:
            part, where = getattr(self, name), f"{type(self).__name__}: {name}"
            laws = [self._smoothed(part_of(law, where, self.kinds)) for law in _each_of(part)]
            object.__setattr__(self, name, tuple(laws) if isinstance(part, tuple) else laws[0])

    @cached_property
    def parts(self) -> tuple[Law, ...]:
        """The laws that it is made of, smoothed over `width` where they smooth sgn(w)."""
        laws = (law for name in self.made_of for law in _each_of(getattr(self, name)))
        return tuple(map(self._smoothed, laws))

    @property
    def inner(self) -> Law:
        """The first part."""
        return self.parts[0]

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether a part depends on the load."""
        return any(law.uses_load for law in self.parts)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.of_parts("torque", theta, x, memory)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.of_parts("limit", theta, x, memory)

    @abstractmethod
    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        """The parts' "torque" or break-away "limit" together, (..., n) [N m]."""

    def starts_together(self) -> list[tuple[tuple[float, ...], ...]]:
        """Values of each part to start fits from, as often as the part with most of them has."""
        longest = max(len(law.initial) for law in self.parts)
        return [
            tuple(law.initial[k % len(law.initial)] for law in self.parts) for k in range(longest)
        ]

    def _smoothed(self, law: Law) -> Law:
        smoothing: dict[str, Any] = {"width": self.width, "shape": self.shape}
        return replace(law, **smoothing) if law.width else law


def _each_of(laws: Any) -> tuple[Any, ...]:
    return laws if isinstance(laws, tuple) else (laws,)


@dataclass(frozen=True)
class PerJoint(CombinedLaw):
    """The laws of the joints by name, in their order.

    Tf_j = law_j(q_j, w_j, u_j, load_j): shoulders with a Stribeck peak, wrists without, and so on.

    laws : name of each joint's law, or one name for all joints; a law with settings is a table such
        as { kind = "stribeck", symmetric = false }

    The parameters are those of all laws together; what a joint's law does not have stays zero.

    >>> law = PerJoint(("stribeck", "coulomb_viscous"))
    >>> law.names
    ('coulomb', 'peak', 'stribeck_velocity', 'viscous')
    >>> law.has_parameters(2).tolist()
    [[True, True, True, True], [True, False, False, True]]
    """

    laws: Annotated[tuple[Any, ...], Field(min_length=1)] = ("coulomb_viscous",)
    width: float = 0.02
    shape: str = "tanh"
    made_of = ("laws",)

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        every = (parameter for law in reversed(self.parts) for parameter in law.parameters[::-1])
        first = {parameter.name: parameter for parameter in every}
        names = dict.fromkeys(name for law in self.parts for name in law.names)
        return tuple(first[name] for name in names)

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        out = []
        for starts in self.starts_together():
            values: dict[str, float] = {}
            for law, start in zip(self.parts, starts, strict=True):
                values = dict(zip(law.names, start, strict=True)) | values
            out.append(tuple(values[name] for name in self.names))
        return tuple(out)

    @cached_property
    def _places(self) -> tuple[list[int], ...]:
        """Places of each joint's parameters among all."""
        return tuple([self.names.index(name) for name in law.names] for law in self.parts)

    @property
    def has_gradient(self) -> bool:
        return all(law.has_gradient for law in self.parts) and not self.has_memory

    @property
    def has_memory(self) -> bool:
        return any(law.has_memory for law in self.parts)

    def has_parameters(self, joints: int) -> NDArray[np.bool_]:
        if len(self.laws) == 1:
            return super().has_parameters(joints)
        if joints != len(self.laws):
            raise InputError(
                f"per_joint: {len(self.laws)} laws for {joints} joint{'s' if joints > 1 else ''}; "
                "give one for each"
            )
        out = np.zeros((joints, len(self.names)), dtype=bool)
        for j, places in enumerate(self._places):
            out[j, places] = True
        return out

    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        parts = self._each(theta, x, memory)
        return _joined([getattr(law, what)(numbers, at, z) for law, numbers, at, z in parts])

    def gradient(self, theta: Array, x: Inputs) -> Array:
        columns = []
        parts = zip(self._each(theta, x, ()), self._places, strict=True)
        for (law, numbers, at, _), places in parts:
            slopes = np.asarray(law.gradient(numbers, at))
            wide = np.zeros((*slopes.shape[:-1], len(self.names)))
            wide[..., places] = slopes
            columns.append(wide)
        return np.concatenate(np.broadcast_arrays(*columns), axis=-2)

    def start(self, theta: Array, x: Inputs) -> Memory:
        parts = self._each(theta, x, ())
        return self._packed([law.start(numbers, at) for law, numbers, at, _ in parts])

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        parts = self._each(theta, x, memory)
        return self._packed([law.advance(numbers, at, z, dt) for law, numbers, at, z in parts])

    @cached_property
    def _entries(self) -> tuple[int, ...]:
        """Number of each joint's entries of memory."""
        still = at_rest(np.zeros((1, 1)))
        return tuple(len(law.start(np.array(law.initial[:1]), still)) for law in self.parts)

    def _each(
        self, theta: Array, x: Inputs, memory: Memory
    ) -> Iterator[tuple[Law, Array, Inputs, Memory]]:
        """Each joint's law, parameters, inputs and memory, the joint's axis of length one."""
        for j, (law, places) in enumerate(zip(self.parts, self._places, strict=True)):
            joint = slice(j, j + 1) if len(self.laws) > 1 else slice(None)
            entries = memory[: self._entries[j]] if memory else ()
            yield (
                law,
                theta[..., joint, :][..., places],
                x.each(lambda entry, joint=joint: entry[..., joint]),
                tuple(entry[..., joint] for entry in entries),
            )

    def _packed(self, memories: list[Memory]) -> Memory:
        """Memories of the joints as entries for all, zero where a joint has fewer."""
        most = max(self._entries)
        if not most:
            return ()
        like = next(entries[0] for entries in memories if entries)
        filled = [(*entries, *(0.0 * like,) * (most - len(entries))) for entries in memories]
        return tuple(map(_joined, zip(*filled, strict=True)))


def _joined(columns: Sequence[Array]) -> Array:
    xp = namespace(*columns)
    joined: Array = xp.concat(xp.broadcast_arrays(*columns), axis=-1)
    return joined


_SHARED = "rad/s"  # unit of parameters that are the same in all laws; all others are factors


@dataclass(frozen=True)
class Sum(CombinedLaw):
    """Tf = sum of the torques of `laws`, static ones by name; what they share counts once.

    laws : their names, such as ["stribeck", "motor_load"]; a law with settings is a table such as
        { kind = "stribeck", symmetric = false }

    The parameters are those of all laws together. A term that several have, such as a Coulomb
    level, also by direction, is that of the first; a velocity that several have is the same.
    `loss` is the share of the motor torque that a gear swallows. Sums of such terms are the
    classical models of friction [Armstrong1994].

    >>> Sum(("stribeck", "motor_load")).names
    ('coulomb', 'peak', 'stribeck_velocity', 'viscous', 'loss')
    """

    laws: Annotated[tuple[Any, ...], Field(min_length=2)] = ("stribeck", "motor_load")
    width: float = 0.02
    shape: str = "tanh"
    made_of = ("laws",)

    def __post_init__(self) -> None:
        super().__post_init__()
        for law in self.laws:
            if law.has_memory:
                raise InputError(f"sum: {law.kind!r} has a memory: a sum is one of laws without")
        seen: set[int | None] = {None}
        for law, places in zip(self.laws, self._layout[1], strict=True):
            if seen.issuperset(places):
                raise InputError(
                    f"sum: {law.kind!r} adds nothing to the laws before it: leave it out"
                )
            seen |= {*places}

    @cached_property
    def _layout(self) -> tuple[list[LawParameter], list[list[int | None]]]:
        """Parameters of the sum; of each law the places of its own, None where they are zero."""
        rows: list[LawParameter] = []
        places: list[list[int | None]] = []
        for law in self.parts:
            stems, names = {stem(row.name) for row in rows}, [row.name for row in rows]
            here: list[int | None] = []
            for parameter in law.parameters:
                if parameter.unit != _SHARED and stem(parameter.name) in stems:
                    here.append(None)
                elif parameter.name in names:
                    here.append(names.index(parameter.name))
                else:
                    here.append(len(rows))
                    rows.append(parameter)
            places.append(here)
        return rows, places

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return tuple(self._layout[0])

    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        first, *others = (getattr(law, what)(numbers, x, ()) for law, numbers in self._each(theta))
        return sum(others, start=first)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        columns: list[Array] = [0.0 * (theta[..., 0] + x.w)] * len(self.names)
        for (law, numbers), places in zip(self._each(theta), self._layout[1], strict=True):
            slopes = law.gradient(numbers, x)
            for i, place in enumerate(places):
                if place is not None:
                    columns[place] = columns[place] + slopes[..., i]
        return namespace(theta, x.w).stack(columns, axis=-1)

    def _each(self, theta: Array) -> Iterator[tuple[Law, Array]]:
        """Each law with its parameters; torques that an earlier law has are zero."""
        zero, xp = 0.0 * theta[..., 0], namespace(theta)
        for law, places in zip(self.parts, self._layout[1], strict=True):
            columns = [zero if place is None else theta[..., place] for place in places]
            yield law, xp.stack(columns, axis=-1)
