"""Blocks of parameters that shooting can free, and the free parameters of a fit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.mechanics import Mechanism

# What blocks of sensors and servos are where these are ideal.
IDEAL = {"delay": 0.0, "gain": 1.0, "bias": 0.0, "offset": 0.0}
IDEAL |= {"target_delay": 0.0, "backlash": 0.0}
_ORDER = ("friction", "base", "torque", "actuator", "angle")


class Estimate(NamedTuple):
    """Current values of a fit: friction (theta (n, P)), calibration (no batch axes), mechanism."""

    friction: Friction
    calibration: Calibration
    mechanism: Mechanism


class Parameter(NamedTuple):
    """One free parameter: block, name, unit, value, bounds, and standard deviation of its prior.

    `place` says where the block keeps it: the joint first, of base parameters their index. The
    prior's deviation is infinite where there is none; its mean is the value that the fit begins
    with, unless `mean` is given. `shared` are names and places of those that have its value.
    """

    block: str
    name: str
    unit: str
    value: float
    low: float = -float("inf")
    high: float = float("inf")
    prior: float = float("inf")
    place: tuple[int, ...] = ()
    mean: float | None = None
    shared: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @property
    def places(self) -> tuple[tuple[int, ...], ...]:
        """All places that have its value."""
        return self.place, *(place for _, place in self.shared)

    @property
    def each(self) -> tuple[Parameter, ...]:
        """The parameter at each of its places, as if it were not shared."""
        others = (self._replace(name=n, place=p, shared=()) for n, p in self.shared)
        return self._replace(shared=()), *others


Values = Sequence[tuple[Parameter, float]]  # new values of free parameters


class Logged(NamedTuple):
    """Motor torque (..., n) as it was logged, delayed, and its derivative by the delay."""

    torque: Array
    by_delay: Array


class ParameterBlock(ABC):
    """Some of the parameters of a fit, free but for those whose names are `fixed`.

    `enters` says which input of the physics they are: "friction", "base", "torque", "angle" or
    "actuator". `known` are standard deviations of priors by the parameters' names.
    """

    name: ClassVar[str]
    enters: ClassVar[str]
    fixed: tuple[str, ...] = ()
    known: tuple[tuple[str, float], ...] = ()

    @abstractmethod
    def parameters(self, estimate: Estimate) -> tuple[Parameter, ...]:
        """The free parameters, with their current values."""

    @abstractmethod
    def with_values(self, estimate: Estimate, values: Values) -> Estimate:
        """The estimate with other values of the block's free parameters."""

    def torque_slope(self, estimate: Estimate, own: Sequence[Parameter], u: Logged) -> Array:
        """Derivatives (E, ..., n) of the motor torque by the block's `own` E free parameters.

        None, (0, ..., n), for a block that does not change the torque.
        """
        return np.empty((0, *u.torque.shape))


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


def all_parameters(blocks: Sequence[FreeBlock]) -> tuple[Parameter, ...]:
    """All free parameters, with the values that the fit begins with."""
    return tuple(p for own in blocks for p in own.parameters)


def prior_precision(parameters: Sequence[Parameter]) -> Array:
    """Precision (D,) of the parameters' priors."""
    return 1.0 / np.array([p.prior for p in parameters]) ** 2


def prior_mean(parameters: Sequence[Parameter]) -> Array:
    """Mean (D,) of the parameters' priors."""
    return np.array([p.value if p.mean is None else p.mean for p in parameters])


def with_values(estimate: Estimate, blocks: Sequence[FreeBlock], values: Array) -> Estimate:
    """The estimate with other values (D,) of all free parameters."""
    for own in blocks:
        new = tuple(zip(own.parameters, values[own.columns], strict=True))
        estimate = own.block.with_values(estimate, new)
    return estimate


def values_of(estimate: Estimate, blocks: Sequence[FreeBlock]) -> Array:
    """Values (D,) of all free parameters in an estimate."""
    return np.array([p.value for own in blocks for p in own.block.parameters(estimate)])


def prior_deviation(prior: float | None, name: str) -> float:
    """Standard deviation of a prior, infinite for none.

    Raises
    ------
    InputError
        Where it is not positive.
    """
    if prior is None:
        return float("inf")
    if not prior > 0:
        raise InputError(f"block {name!r}: prior = {prior} must be a positive standard deviation")
    return float(prior)


def relative_deviation(prior: float | None, name: str, value: float) -> float:
    """Standard deviation of a prior that is given relative to a value, infinite for none."""
    deviation = prior_deviation(prior, name)
    return deviation * max(abs(value), 1e-12) if prior else deviation


def with_known(
    parameters: Iterable[Parameter], known: Sequence[tuple[str, float]]
) -> tuple[Parameter, ...]:
    """The parameters, those of known names with priors at least as narrow."""
    deviations = dict(known)
    return tuple(
        p._replace(prior=min(p.prior, deviations.get(p.name, float("inf")))) for p in parameters
    )


def check_fixed(fixed: Sequence[str], known: Sequence[str], block: str, what: str) -> None:
    """Check that fixed parameters are known ones.

    Raises
    ------
    InputError
        With the first that is not.
    """
    for name in fixed:
        if name not in known:
            raise InputError(
                f"block {block!r}: {what} {name!r} to fix; known are {', '.join(known)}"
            )
