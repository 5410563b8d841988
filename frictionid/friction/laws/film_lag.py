"""Frictional lag: the lubricating film follows the speed late, and the level follows the film.

dz/dt = (|w| - z) / lag,   Tf = g(z) sgn(w) + Fv w,   g(z) = Fc + Fp exp(-(z/ws)^2)   [Olsson1998]

Only the film lags: a low-pass behind the whole friction curve would creep at rest and drive. A
joint that stands still breaks away at the level of the film's momentary height z, so that the level
grows while it stands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL, VELOCITY, level, level_by_direction
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign

_LAG = (1e-3, 1.0)  # [s]; what is faster than a millisecond is no memory
_STARTS = tuple((ws, lag) for lag in (0.01, 0.06) for ws in (0.5, 1.2, 3.0, 8.0, 20.0))


@dataclass(frozen=True)
class FilmLag(Law):
    """Stribeck friction whose peak follows the speed with the time constant `lag` [s].

    Memory is the film's height z >= 0, written as the speed [rad/s] at which it would be steady; it
    starts so, and advances by the exact solution for a constant speed.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "peak", "stribeck_velocity", "viscous", "lag")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m", "rad/s", "N m s/rad", "s")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL, LEVEL, VELOCITY, LEVEL, _LAG)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, ws, 0.0, lag) for ws, lag in _STARTS
    )

    def __post_init__(self) -> None:
        check_sign("film_lag", self.width, self.shape)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (_steady(theta, x),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return level(theta, memory[0]) * sign + theta[..., 3] * x.w

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return (_followed(memory[0], x.w, theta[..., 4], dt),)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return level(theta, memory[0]) + 0.0 * x.w


@dataclass(frozen=True)
class AsymmetricFilmLag(Law):
    """Film lag with its own Coulomb level and peak in each direction, as in `AsymmetricStribeck`.

    The film, and with it the Stribeck velocity and the lag, is one for both directions.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = (
        "coulomb_positive",
        "coulomb_negative",
        "peak_positive",
        "peak_negative",
        "stribeck_velocity",
        "viscous",
        "lag",
    )
    units: ClassVar[tuple[str, ...]] = ("N m",) * 4 + ("rad/s", "N m s/rad", "s")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 4 + (VELOCITY, LEVEL, _LAG)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, 0.0, 0.0, ws, 0.0, lag) for ws, lag in _STARTS
    )

    def __post_init__(self) -> None:
        check_sign("film_lag", self.width, self.shape)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (_steady(theta, x),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return level_by_direction(theta, memory[0], x.w) * sign + theta[..., 5] * x.w

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return (_followed(memory[0], x.w, theta[..., 6], dt),)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return level_by_direction(theta, memory[0], x.w)


def _steady(theta: Array, x: Inputs) -> Array:
    return namespace(x.w).abs(x.w) + 0.0 * theta[..., 0]


def _followed(z: Array, w: Array, lag: Array, dt: Array) -> Array:
    """Height of the film after dt at the velocity w."""
    xp = namespace(z, w)
    speed = xp.abs(w)
    return speed + (z - speed) * xp.exp(-dt / lag)
