"""Friction that grows with the force in the bearing: Tf = (Fc + c load) sgn(w) + Fv w.

The bearing load [N] is that of `Mechanism.load`: the force that a joint passes on to all bodies
beyond it, in friction-free motion. Fast swings and heavy tools press joints together, and the more
they are pressed, the more they rub [Armstrong1994].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.law import LinearLaw
from frictionid.friction.laws.levels import LEVEL, VELOCITIES, StribeckLevel
from frictionid.friction.smooth_sign import smooth_sign

_STRIBECK = StribeckLevel()


@dataclass(frozen=True)
class LoadDependent(LinearLaw):
    """Tf = (coulomb + load_coefficient load) sgn(w) + viscous w, sgn smoothed over `width`.

    `load_coefficient` is the coefficient of friction times the radius at which the bearing rubs.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "load_coefficient", "viscous")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m/N", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 3
    uses_load = True

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        return {0: 1.0, 1: x.load}

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {2: x.w}


@dataclass(frozen=True)
class LoadDependentStribeck(Law):
    """Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2) + c load) sgn(w) + viscous w.

    c is the `load_coefficient`, as in `LoadDependent`.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = (*_STRIBECK.names, "load_coefficient", "viscous")
    units: ClassVar[tuple[str, ...]] = (*_STRIBECK.units, "N m/N", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (*_STRIBECK.bounds, LEVEL, LEVEL)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (*_STRIBECK.start(ws), 0.0, 0.0) for ws in VELOCITIES
    )
    uses_load = True

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = _STRIBECK.at(theta, x.w, x.w) + theta[..., 3] * x.load
        return level * smooth_sign(x.w, self.width, self.shape) + theta[..., 4] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape) + 0.0 * theta[..., 0]
        columns = _STRIBECK.gradient(theta, x.w, sign)
        columns += [x.load * sign, x.w + 0.0 * sign]
        return namespace(theta, x.w).stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return _STRIBECK.at_rest(theta, x.w) + theta[..., 3] * x.load
