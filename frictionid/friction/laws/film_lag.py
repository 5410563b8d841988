"""Frictional lag: the lubricating film follows the speed late, and the level follows the film.

dz/dt = (|w| - z) / lag,   Tf = g(z) sgn(w) + Fv w,   g(z) = Fc + Fp exp(-(z/ws)^2)   [Olsson1998]

Only the film lags: a low-pass behind the whole friction curve would creep at rest and drive. A
joint that stands still breaks away at the level of the film's momentary height z, so that the level
grows while it stands.
"""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import COARSE_VELOCITIES, LEVEL, StribeckLevel, stribeck_level
from frictionid.friction.smooth_sign import smooth_sign

_LAG = (1e-3, 1.0)  # [s]; what is faster than a millisecond is no memory
_STARTS = tuple((ws, lag) for lag in (0.01, 0.06) for ws in COARSE_VELOCITIES)


@dataclass(frozen=True)
class FilmLag(Law):
    """Tf = (coulomb + peak exp(-(z/stribeck_velocity)^2)) sgn(w) + viscous w, z = |w| after `lag`.

    The film z follows the speed with the time constant `lag` [s]. Memory is the film's height
    z >= 0, written as the speed [rad/s] at which it would be steady; it starts so, and advances by
    the exact solution for a constant speed.

    symmetric : false gives each direction a Coulomb level and a peak; the film is one for both
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True
    stepwise = ("stribeck_velocity", "lag")

    @property
    def stribeck(self) -> StribeckLevel:
        """The level, of both directions or of each."""
        return stribeck_level(self.symmetric)

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.stribeck.names, "viscous", "lag")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.stribeck.units, "N m s/rad", "s")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.stribeck.bounds, LEVEL, _LAG)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple((*self.stribeck.start(ws), 0.0, lag) for ws, lag in _STARTS)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (namespace(x.w).abs(x.w) + 0.0 * theta[..., 0],)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return self.stribeck.at(theta, memory[0], x.w) * sign + theta[..., -2] * x.w

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array]:
        xp = namespace(x.w, theta)
        return xp.abs(x.w), xp.exp(-dt / theta[..., -1])

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.stribeck.at(theta, memory[0], x.w) + 0.0 * x.w
