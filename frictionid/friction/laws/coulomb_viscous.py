"""Coulomb and viscous friction: Tf = Fc sgn(w) + Fv w [Olsson1998]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.law import LinearLaw
from frictionid.friction.laws.levels import LEVEL, SIDES, by_side


@dataclass(frozen=True)
class CoulombViscous(LinearLaw):
    """Tf = coulomb sgn(w) + viscous w, with sgn smoothed over `width`.

    The physics step holds a joint at rest by itself; the width only has to be well below the
    velocities of interest [Olsson1998].

    symmetric : false gives each direction a Coulomb level, `coulomb_positive` for w > 0 and
        `coulomb_negative` for w < 0; both are positive numbers
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        levels = ("coulomb",) if self.symmetric else tuple(f"coulomb{side}" for side in SIDES)
        return (*levels, "viscous")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("N m",) * (len(self.names) - 1), "N m s/rad")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (LEVEL,) * len(self.names)

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        return {0: 1.0} if self.symmetric else dict(enumerate(by_side(x.w, 1.0 + 0.0 * x.w)))

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {1 if self.symmetric else 2: x.w}


@dataclass(frozen=True)
class NoFriction(Law):
    """Tf = 0. It has no parameters: theta has shape (..., n, 0)."""

    kind = "none"
    names: ClassVar[tuple[str, ...]] = ()
    units: ClassVar[tuple[str, ...]] = ()
    bounds: ClassVar[tuple[tuple[float, float], ...]] = ()

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * x.w + theta.sum(-1)  # the empty sum is zero and carries theta's batch axes

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return (0.0 * x.w)[..., None] + theta

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.torque(theta, x, ())


@dataclass(frozen=True)
class Quadratic(LinearLaw):
    """Tf = coulomb sgn(w) + viscous w + drag w |w|, with sgn smoothed over `width`.

    The drag is that of the air, or of oil that is churned; it may also stand for what the torque
    constant of a motor loses with its speed.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "viscous", "drag")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m s/rad", "N m s^2/rad^2")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 3

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        return {0: 1.0}

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {1: x.w, 2: x.w * namespace(x.w).abs(x.w)}
