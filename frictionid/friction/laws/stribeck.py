"""Stribeck friction: break-away level that falls to the Coulomb level as sliding sets in.

Tf = (Fc + Fp exp(-(w/ws)^2)) sgn(w) + Fv w, break-away at Fc + Fp [Olsson1998].
"""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL, VELOCITIES, StribeckLevel, stribeck_level
from frictionid.friction.smooth_sign import smooth_sign


@dataclass(frozen=True)
class Stribeck(Law):
    """Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2)) sgn(w) + viscous w.

    `peak` is the break-away minus the Coulomb level; sgn is smoothed over `width`.

    symmetric : false gives each direction a Coulomb level and a peak; the Stribeck velocity and the
        viscous coefficient are shared
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True

    @property
    def stribeck(self) -> StribeckLevel:
        """The level, of both directions or of each."""
        return stribeck_level(self.symmetric)

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.stribeck.names, "viscous")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.stribeck.units, "N m s/rad")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.stribeck.bounds, LEVEL)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple((*self.stribeck.start(ws), 0.0) for ws in VELOCITIES)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return self.stribeck.at(theta, x.w, x.w) * sign + theta[..., -1] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        columns = self.stribeck.gradient(theta, x.w, sign)
        return namespace(theta, x.w).stack([*columns, x.w + 0.0 * columns[-1]], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.stribeck.at_rest(theta, x.w)
