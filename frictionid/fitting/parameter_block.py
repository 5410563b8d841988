"""Parameters that a fit may free, in blocks, and all free ones as one vector.

A block lists its parameters. Each has a tolerance: zero where it is held, infinite where it is
free, and the standard deviation of its prior in between.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.plants import Calibration
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism

# What blocks of sensors and servos are where these are ideal.
IDEAL = {
    "delay": 0.0,
    "gain": 1.0,
    "bias": 0.0,
    "offset": 0.0,
    "target_delay": 0.0,
    "backlash": 0.0,
}
_ORDER = ("friction", "base", "torque", "actuator", "angle")
FREE = float("inf")
_FACTOR = 3.0  # of a velocity in one step


class Estimate(NamedTuple):
    """Current values of a fit: friction (theta (n, P)), calibration (no batch axes), mechanism."""

    friction: Friction
    calibration: Calibration
    mechanism: Mechanism


Key = tuple[str, tuple[int, ...]]  # of a parameter: its block, and its place there


class Parameter(NamedTuple):
    """One parameter of a fit: block, name, unit, value, bounds, and tolerance.

    tolerance : 0 holds it, infinity lets it go, else the standard deviation of its prior about
        `mean`, or about the value that the fit begins with
    excess : how many times more its prior weighs than the curvature of the data says, which
        counts samples as independent
    place : where the block keeps it: the joint first, of base parameters their index
    shared : names and places of those that have its value
    size : how far from a law's neutral value it usually is; infinite where it has none
    """

    block: str
    name: str
    unit: str
    value: float
    low: float = -FREE
    high: float = FREE
    tolerance: float = FREE
    place: tuple[int, ...] = ()
    mean: float | None = None
    shared: tuple[tuple[str, tuple[int, ...]], ...] = ()
    excess: float = 1.0
    size: float = FREE

    @property
    def key(self) -> Key:
        """What tells it from others."""
        return self.block, self.place

    @property
    def is_velocity(self) -> bool:
        """Whether it is a velocity of a law."""
        return self.block == "friction" and self.unit in ("rad/s", "m/s")

    @property
    def places(self) -> tuple[tuple[int, ...], ...]:
        """All places that have its value."""
        return self.place, *(place for _, place in self.shared)

    @property
    def each(self) -> "tuple[Parameter, ...]":
        """The parameter at each of its places, as if it were not shared."""
        others = (self._replace(name=n, place=p, shared=()) for n, p in self.shared)
        return self._replace(shared=()), *others


Values = Sequence[tuple[Parameter, float]]  # new values of free parameters


@dataclass(frozen=True)
class ParameterBlock(ABC):
    """Some of the parameters of a fit, free but for those whose names are `fixed`.

    enters : which input of the physics they are: "friction", "base", "torque", "angle" or
        "actuator"
    prior : standard deviation of their priors; relative to each value where `relative`
    excess : how many times more priors weigh, by the parameters' names
    offered : whether the block is only free where the data can tell it, and shows something
    deviations : standard deviations of priors by the parameters' names
    """

    fixed: tuple[str, ...] = ()
    prior: float | None = None
    deviations: tuple[tuple[str, float], ...] = ()
    excess: tuple[tuple[str, float], ...] = ()
    offered: bool = False
    name: ClassVar[str]
    enters: ClassVar[str]
    part: ClassVar[str] = ""  # of the calibration, where it has another name
    relative: ClassVar[bool] = False

    @abstractmethod
    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        """All parameters of the block, with their current values."""

    def names(self, estimate: Estimate) -> tuple[Sequence[str], str]:
        """What can be fixed, and the words for what cannot: names of joints."""
        return estimate.mechanism.joints, f"{estimate.mechanism.kind} has no joint"

    def sizes(self, parameters: Sequence[Parameter]) -> list[float]:
        """Sizes that a relative prior counts in."""
        return [abs(p.value) for p in parameters]

    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        """The free parameters, with their current values."""
        check_fixed(self.fixed, *self.names(estimate), self.name)
        if self.prior is not None and not self.prior > 0:
            raise InputError(
                f"block {self.name!r}: prior = {self.prior} must be a positive standard deviation"
            )
        listed, free = list(self.listed(estimate)), []
        deviations, excess = dict(self.deviations), dict(self.excess)
        sizes = self.sizes(listed) if self.relative else [1.0] * len(listed)
        for p, size in zip(listed, sizes, strict=True):
            prior = FREE if self.prior is None else self.prior * max(size, 1e-12)
            tolerance = min(p.tolerance, prior, deviations.get(p.name, FREE))
            # by the name, or its part before or behind " of "
            is_fixed = not {p.name, *p.name.split(" of ", 1)}.isdisjoint(self.fixed)
            if tolerance > 0 and not is_fixed:
                free.append(p._replace(tolerance=tolerance, excess=excess.get(p.name, 1.0)))
        return tuple(free)

    def numbers(self, estimate: Estimate) -> Array:
        """The numbers, free or not, among which `place` finds each parameter."""
        return np.asarray(getattr(estimate.calibration, self.part or self.name), dtype=float)

    def places(self, parameter: Parameter) -> Sequence[Any]:
        """Where the numbers have its value."""
        return parameter.places

    def values(self, estimate: Estimate, free: Sequence[Parameter]) -> list[float]:
        """Values of the block's free parameters."""
        numbers = self.numbers(estimate)
        return [float(numbers[self.places(p)[0]]) for p in free]

    def with_numbers(self, estimate: Estimate, numbers: Array) -> Estimate:
        """The estimate with other numbers."""
        new = replace(estimate.calibration, **{self.part or self.name: numbers})
        return estimate._replace(calibration=new)

    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        """The estimate with other values of the block's free parameters."""
        new = self.numbers(estimate).copy()
        for parameter, value in values:
            for place in self.places(parameter):
                new[place] = value
        return self.with_numbers(estimate, new)

    def torque_slope(
        self, estimate: Estimate, free: Sequence[Parameter], u: Array, by_delay: Array
    ) -> Array:
        """Derivatives (E, ..., n) of the motor torque by the block's E free parameters.

        None, (0, ..., n), for a block that does not change the torque.

        u (..., n) : the torque as it was logged, delayed; by_delay : its derivative by the delay
        """
        return np.empty((0, *u.shape))


def check_fixed(fixed: Sequence[str], names: Sequence[str], what: str, block: str) -> None:
    """Check that fixed parameters are among those that there are."""
    for name in fixed:
        if name not in names:
            raise InputError(
                f"block {block!r}: {what} {name!r} to fix; known are {', '.join(names)}"
            )


def have_prior(parameters: Mapping[str, Sequence[Parameter]]) -> bool:
    """Whether a free parameter of the blocks, by their names, has a prior."""
    return any(np.isfinite(p.tolerance) for group in parameters.values() for p in group)


def with_excess(
    blocks: Sequence[ParameterBlock], parameters: Sequence[Parameter], excess: Array
) -> tuple[ParameterBlock, ...]:
    """The blocks with priors that weigh so many times more (D,) than the curvature says."""
    pairs = tuple((p.block, p.name, float(e)) for p, e in zip(parameters, excess, strict=True))
    return tuple(
        replace(b, excess=tuple((name, e) for block, name, e in pairs if block == b.name))
        for b in blocks
    )


class FreeBlock(NamedTuple):
    """A block with its free parameters, at `columns` of all free parameters."""

    block: ParameterBlock
    parameters: tuple[Parameter, ...]
    columns: slice


def free_blocks(blocks: Sequence[ParameterBlock], estimate: Estimate) -> tuple[FreeBlock, ...]:
    """The blocks in the order of the derivatives, with their free parameters."""
    out, first = [], 0
    for block in sorted(blocks, key=lambda b: _ORDER.index(b.enters)):
        parameters = block.parameters(estimate)
        out.append(FreeBlock(block, parameters, slice(first, first + len(parameters))))
        first += len(parameters)
    return tuple(out)


class Limits(NamedTuple):
    """What holds D parameters, (D,) each: bounds, and mean and precision of their priors."""

    low: Array
    high: Array
    mean: Array
    precision: Array


def limits_of(parameters: Sequence[Parameter]) -> Limits:
    """Bounds and priors of parameters; precision zero for those without a prior."""
    rows = [
        (p.low, p.high, p.value if p.mean is None else p.mean, p.excess / p.tolerance**2)
        for p in parameters
    ]
    return Limits(*np.reshape(rows, (-1, 4)).T)


class FreeParameters:
    """What `blocks` free, of a fit that begins somewhere."""

    blocks: tuple[FreeBlock, ...]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All free parameters, with the values that the fit begins with."""
        return tuple(p for free in self.blocks for p in free.parameters)

    @property
    def limits(self) -> Limits:
        """Bounds and priors of the parameters."""
        return limits_of(self.parameters)


def reach(parameters: Sequence[Parameter], value: Array) -> tuple[Array, Array]:
    """How far down and up (D,) one step may move parameters of friction: a trust region.

    A linearisation at one peak or memory tells little of others far off, from which there may be no
    way back. Parameters with a neutral value move by their size, velocities by a factor.
    """
    size = np.array([p.size for p in parameters])
    by_factor = np.array([p.is_velocity and np.isinf(p.size) for p in parameters], dtype=bool)
    return (
        np.where(by_factor, (1.0 - 1.0 / _FACTOR) * value, size),
        np.where(by_factor, (_FACTOR - 1.0) * value, size),
    )


def with_values(estimate: Estimate, blocks: Sequence[FreeBlock], values: Array) -> Estimate:
    """The estimate with other values (D,) of all free parameters."""
    for free in blocks:
        new = tuple(zip(free.parameters, values[free.columns], strict=True))
        estimate = free.block.with_values(estimate, new)
    return estimate


def values_of(estimate: Estimate, blocks: Sequence[FreeBlock]) -> Array:
    """Values (D,) of all free parameters in an estimate."""
    return np.concatenate([[], *(f.block.values(estimate, f.parameters) for f in blocks)])
