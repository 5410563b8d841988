"""Friction of a joint that warms up: a Coulomb level and viscous terms that follow a temperature.

Fc(T) = Fc (1 + a (T - T0)),   Fv(T) = Fv exp(-b (T - T0))

Viscous friction falls with the temperature as the viscosity of the lubricant, exponentially, the
level by a straight line, after the measurements of a robot's joint in [Bittencourt2012]. There a
part of viscous friction is constant beside it, and of the level the peak alone changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.per_joint import PARTS, Name, smoothed_part

_LEVEL = "N m"  # units of parameters that are levels of friction, and of viscous terms
_VISCOUS = ("N m s/rad", "N m s^2/rad^2")
_SLOPES = (-0.05, 0.05)  # [1/K]
_DECAYS = (-0.05, 0.2)


@dataclass(frozen=True)
class Thermal(Law):
    """Tf = Fc (1 + a (T - T0)) sgn(w) + Fv exp(-b (T - T0)) w: friction of a joint that warms up.

    law : name of a static law, whose parameters keep their names, and are those at T0
    reference : T0 [degC]

    Of any law, `coulomb_slope` a [1/K] belongs to all parameters that are torques,
    `viscous_decay` b [1/K] to those that are torques per velocity or its square; velocities and
    shares of a load stay. Levels do not fall below zero. T [degC] is that of the joint; where none
    is known, that is T0.

    >>> Thermal().names
    ('coulomb', 'viscous', 'coulomb_slope', 'viscous_decay')
    """

    law: Name = "coulomb_viscous"
    reference: float = 25.0
    width: float = 0.02
    shape: str = "tanh"
    uses_temperature = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.law == "none" or PARTS[self.law].has_memory:
            why = "is no friction" if self.law == "none" else "has a memory"
            raise InputError(f"thermal: law = {self.law!r} {why}: name a static law")

    @cached_property
    def inner(self) -> Law:
        """The law at one temperature, smoothed over `width`."""
        return smoothed_part(self.law, self.width, self.shape)

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.inner.names, "coulomb_slope", "viscous_decay")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.inner.units, "1/K", "1/K")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.inner.bounds, _SLOPES, _DECAYS)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple((*start, 0.0, 0.0) for start in self.inner.initial)

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether the law does."""
        return self.inner.uses_load

    def at_temperature(self, theta: Array, temperature: Array) -> tuple[Law, Array]:
        level, viscous = self._factors(theta, temperature)
        own = [
            theta[..., i] * (level if unit == _LEVEL else viscous if unit in _VISCOUS else 1.0)
            for i, unit in enumerate(self.inner.units)
        ]
        xp = namespace(theta, temperature)
        return self.inner, xp.stack(xp.broadcast_arrays(*own), axis=-1)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.torque(self._own(theta, x), x, ())

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.inner.limit(self._own(theta, x), x, ())

    def gradient(self, theta: Array, x: Inputs) -> Array:
        slopes = self.inner.gradient(self._own(theta, x), x)
        zero = 0.0 * slopes[..., 0]
        warmer = zero if x.temperature is None else x.temperature - self.reference + zero
        level, viscous = self._factors(theta, x.temperature)
        rising = namespace(zero).where(level > 0.0, warmer, zero)
        columns, by_slope, by_decay = [], zero, zero
        for i, unit in enumerate(self.inner.units):
            own = slopes[..., i]
            if unit == _LEVEL:
                columns.append(own * level)
                by_slope = by_slope + own * theta[..., i] * rising
            elif unit in _VISCOUS:
                columns.append(own * viscous)
                by_decay = by_decay - own * theta[..., i] * viscous * warmer
            else:
                columns.append(own)
        return namespace(zero).stack([*columns, by_slope, by_decay], axis=-1)

    def _own(self, theta: Array, x: Inputs) -> Array:
        """Parameters of the law at the temperature of inputs."""
        return (
            theta[..., :-2]
            if x.temperature is None
            else self.at_temperature(theta, x.temperature)[1]
        )

    def _factors(self, theta: Array, temperature: Array | None) -> tuple[Array, Array]:
        """Factors (..., n) of levels and of viscous terms."""
        a, b, xp = theta[..., -2], theta[..., -1], namespace(theta)
        warmer = 0.0 * a if temperature is None else temperature - self.reference
        level = 1.0 + a * warmer
        return xp.maximum(level, 0.0 * level), xp.exp(-b * warmer)
