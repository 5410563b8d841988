"""Friction that grows with the force in the bearing: Tf = (Fc + c load) sgn(w) + Fv w.

The bearing load [N] is that of `Mechanism.load`: the force that a joint passes on to all bodies
beyond it, in friction-free motion. Fast swings and heavy tools press joints together, and the more
they are pressed, the more they rub [Armstrong1994].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Memory
from frictionid.friction.law import LinearLaw
from frictionid.friction.laws.levels import LEVEL, VELOCITIES, StribeckLevel
from frictionid.friction.smooth_sign import smooth_sign

_STRIBECK = StribeckLevel()


@dataclass(frozen=True)
class LoadDependent(LinearLaw):
    """Tf = (coulomb + load_coefficient load) sgn(w) + viscous w, sgn smoothed over `width`.

    `load_coefficient` is the coefficient of friction times the radius at which the bearing rubs.

    stribeck : true adds the peak of Stribeck friction to the level, peak exp(-(w/ws)^2)
    """

    width: float = 0.02
    shape: str = "tanh"
    stribeck: bool = False
    uses_load = True

    @property
    def is_linear(self) -> bool:  # type: ignore[override]
        """Whether there is no peak, whose velocity is not linear."""
        return not self.stribeck

    @property
    def names(self) -> tuple[str, ...]:
        level = _STRIBECK.names if self.stribeck else ("coulomb",)
        return (*level, "load_coefficient", "viscous")

    @property
    def units(self) -> tuple[str, ...]:
        level = _STRIBECK.units if self.stribeck else ("N m",)
        return (*level, "N m/N", "N m s/rad")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        level = _STRIBECK.bounds if self.stribeck else (LEVEL,)
        return (*level, LEVEL, LEVEL)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        if not self.stribeck:
            return super().initial
        return tuple((*_STRIBECK.start(ws), 0.0, 0.0) for ws in VELOCITIES)

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        return {0: 1.0, 1: x.load}

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {2: x.w}

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        if not self.stribeck:
            return super().torque(theta, x, memory)
        level = _STRIBECK.at(theta, x.w, x.w) + theta[..., 3] * x.load
        return level * smooth_sign(x.w, self.width, self.shape) + theta[..., 4] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        if not self.stribeck:
            return super().gradient(theta, x)
        sign = smooth_sign(x.w, self.width, self.shape) + 0.0 * theta[..., 0]
        columns = _STRIBECK.gradient(theta, x.w, sign)
        columns += [x.load * sign, x.w + 0.0 * sign]
        return namespace(theta, x.w).stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        if not self.stribeck:
            return super().limit(theta, x, memory)
        return _STRIBECK.at_rest(theta, x.w) + theta[..., 3] * x.load
