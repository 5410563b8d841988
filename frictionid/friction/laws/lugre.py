"""LuGre friction: bristles that bend before a joint slips, and then slide at the Stribeck level.

dz/dt = w - s0 |w| z / g(w),   Tf = s0 z + s1(w) dz/dt + Fv w   [CanudasDeWit1995], [Olsson1998]
g(w) = Fc + Fp exp(-(w/ws)^2)

With a constant s1 this can drive. Here s1(w) = damping exp(-(w/damping_velocity)^2), and never more
than 4 g(w)/|w|, nor than 4 g(w)/width: with x = s0 z, what friction takes less what the bristles
store is

w Tf - d(s0 z^2/2)/dt = |w| x^2/g + (s1 |w|/g) x dz/dt + s1 (dz/dt)^2 + Fv w^2

and s1 |w| <= 4 g is what makes this quadratic form positive.
"""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.dahl import PRESLIDING, PRESLIDINGS, bristle_rate, bristle_relaxation
from frictionid.friction.laws.levels import (
    COARSE_VELOCITIES,
    LEVEL,
    VELOCITY,
    StribeckLevel,
    stribeck_factor,
    stribeck_level,
)
from frictionid.friction.smooth_sign import smooth_sign

_DAMPING_START = 0.1
_STARTS = tuple((ws, z) for z in PRESLIDINGS for ws in COARSE_VELOCITIES)
_TINY = 1e-12  # no division by zero where there is no friction, or no motion


@dataclass(frozen=True)
class LuGre(Law):
    """Tf = stiffness z + damping(w) dz/dt + viscous w, LuGre's bristles at the Stribeck level.

    They bend by z, up to `presliding` [rad], before a joint breaks away. Their stiffness is s0 =
    break-away level / presliding [N m/rad], with the mean of the levels of both sides, so that
    Stribeck friction is the limit of small `presliding`. Memory is their deflection z [rad]. It
    starts as in steady sliding; at rest it is not known, and is taken to grow over `width` [rad/s].
    At rest the bristles hold the joint, there is no break-away level. After the level's parameters,
    theta holds viscous, presliding, damping, damping_velocity.

    symmetric : false gives each direction a Coulomb level and a peak; the bristles are the same
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True
    kind = "lugre"

    @property
    def stribeck(self) -> StribeckLevel:
        """The level, of both directions or of each."""
        return stribeck_level(self.symmetric)

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.stribeck.names, "viscous", "presliding", "damping", "damping_velocity")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.stribeck.units, "N m s/rad", "rad", "N m s/rad", "rad/s")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.stribeck.bounds, LEVEL, PRESLIDING, LEVEL, VELOCITY)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        ends = ((ws, (0.0, z, 0.0, _DAMPING_START)) for ws, z in _STARTS)
        return tuple((*self.stribeck.start(ws), *end) for ws, end in ends)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (self._deflection(theta, x.w) * smooth_sign(x.w, self.width, self.shape),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        w, z, xp = x.w, memory[0], namespace(theta, x.w)
        fading = theta[..., -2] * stribeck_factor(w, theta[..., -1])
        # below `width` the limit grows no further: a law without one is too steep to be resolved,
        # and data that do not show the damping would lead there
        speed = xp.maximum(xp.abs(w), self.width + 0.0 * w)
        damping = xp.minimum(fading, 4.0 * self.stribeck.at(theta, w, w) / speed)
        stiffness = self.stribeck.mean_at_rest(theta) / theta[..., -3]
        rate = bristle_rate(z, w, self._deflection(theta, w))
        return stiffness * z + damping * rate + theta[..., -4] * w

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array]:
        return bristle_relaxation(x.w, self._deflection(theta, x.w), dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def sharpened(self) -> Law:
        """The law itself: its smoothing says how the bristles start, they hold the joint."""
        return self

    def _deflection(self, theta: Array, w: Array) -> Array:
        """Deflection in steady sliding [rad], > 0: presliding g(w) / s0; presliding if g = 0."""
        level, top = self.stribeck.at(theta, w, w), self.stribeck.mean_at_rest(theta)
        xp = namespace(level, top)
        share = level / xp.where(top == 0, xp.ones_like(top), top)
        share = xp.where(top == 0, xp.ones_like(share), share)
        return theta[..., -3] * xp.maximum(share, _TINY + 0.0 * share)
