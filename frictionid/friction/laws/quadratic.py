"""Coulomb and viscous friction, and a drag that grows with a power of the velocity [Olsson1998]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs
from frictionid.friction.laws.levels import LEVEL
from frictionid.friction.laws.linear_law import LinearLaw


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
