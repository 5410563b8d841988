"""Friction of a joint that warms up: a Coulomb level and viscous terms that follow a temperature.

Fc(T) = Fc (1 + a (T - T0)),   Fv(T) = Fv exp(-b (T - T0))

Viscous friction falls with the temperature as the viscosity of the lubricant, exponentially, the
level by a straight line, after the measurements of a robot's joint in [Bittencourt2012]. There a
part of viscous friction is constant beside it, and of the level the peak alone changes.
"""

from dataclasses import dataclass
from typing import Any

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory

from .combined import CombinedLaw

_LEVEL = "N m"  # units of parameters that are levels of friction, and of viscous terms
_VISCOUS = ("N m s/rad", "N m s^2/rad^2")
_WARMING = (
    LawParameter("coulomb_slope", "1/K", -0.05, 0.05, size=0.01),
    LawParameter("viscous_decay", "1/K", -0.05, 0.2, size=0.05),
)


@dataclass(frozen=True)
class Thermal(CombinedLaw):
    """Tf = Fc (1 + a (T - T0)) sgn(w) + Fv exp(-b (T - T0)) w: friction of a joint that warms up.

    law : name of a static law, whose parameters keep their names, and are those at T0; one with
        settings is a table such as { kind = "stribeck", symmetric = false }
    reference : T0 [degC]

    Of any law, `coulomb_slope` a [1/K] belongs to all parameters that are torques,
    `viscous_decay` b [1/K] to those that are torques per velocity or its square; velocities and
    shares of a load stay. Levels do not fall below zero. T [degC] is that of the joint; where none
    is known, that is T0.

    >>> Thermal().names
    ('coulomb', 'viscous', 'coulomb_slope', 'viscous_decay')
    """

    law: Any = "coulomb_viscous"
    reference: float = 25.0
    width: float = 0.02
    shape: str = "tanh"
    uses_temperature = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inner.has_memory or not self.inner.names:
            why = "has a memory" if self.inner.has_memory else "is no friction"
            raise InputError(f"thermal: law = {self.inner.kind!r} {why}: name a static law")

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return (*self.inner.parameters, *_WARMING)

    def at_temperature(self, theta: Array, temperature: Array) -> tuple[Law, Array]:
        level, viscous = self._factors(theta, temperature)
        columns = [
            theta[..., i] * (level if unit == _LEVEL else viscous if unit in _VISCOUS else 1.0)
            for i, unit in enumerate(self.inner.units)
        ]
        xp = namespace(theta, temperature)
        return self.inner, xp.stack(xp.broadcast_arrays(*columns), axis=-1)

    def of_parts(self, what: str, theta: Array, x: Inputs, memory: Memory) -> Array:
        torque: Array = getattr(self.inner, what)(self._warm(theta, x), x, ())
        return torque

    def gradient(self, theta: Array, x: Inputs) -> Array:
        slopes = self.inner.gradient(self._warm(theta, x), x)
        zero = 0.0 * slopes[..., 0]
        warmer = zero if x.temperature is None else x.temperature - self.reference + zero
        level, viscous = self._factors(theta, x.temperature)
        rising = namespace(zero).where(level > 0.0, warmer, zero)
        columns, by_slope, by_decay = [], zero, zero
        for i, unit in enumerate(self.inner.units):
            column = slopes[..., i]
            if unit == _LEVEL:
                columns.append(column * level)
                by_slope = by_slope + column * theta[..., i] * rising
            elif unit in _VISCOUS:
                columns.append(column * viscous)
                by_decay = by_decay - column * theta[..., i] * viscous * warmer
            else:
                columns.append(column)
        return namespace(zero).stack([*columns, by_slope, by_decay], axis=-1)

    def _warm(self, theta: Array, x: Inputs) -> Array:
        """Parameters of the law at the temperature of inputs."""
        warm = x.temperature
        return theta[..., :-2] if warm is None else self.at_temperature(theta, warm)[1]

    def _factors(self, theta: Array, temperature: Array | None) -> tuple[Array, Array]:
        """Factors (..., n) of levels and of viscous terms."""
        a, b, xp = theta[..., -2], theta[..., -1], namespace(theta)
        warmer = 0.0 * a if temperature is None else temperature - self.reference
        level = 1.0 + a * warmer
        return xp.maximum(level, 0.0 * level), xp.exp(-b * warmer)
