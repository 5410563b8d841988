"""Friction that grows with the force in the bearing: Tf = (Fc + c load) sgn(w) + Fv w.

The bearing load [N] is that of `Mechanism.load`: the force that a joint passes on to all bodies
beyond it, in friction-free motion. Fast swings and heavy tools press joints together, and the more
they are pressed, the more they rub [Armstrong1994].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL, VELOCITIES, VELOCITY, level, stribeck_factor
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign


@dataclass(frozen=True)
class LoadDependent(Law):
    """Tf = (coulomb + load_coefficient load) sgn(w) + viscous w, sgn smoothed over `width` [rad/s].

    `load_coefficient` is the coefficient of friction times the radius at which the bearing rubs.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "load_coefficient", "viscous")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m/N", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL,) * 3
    uses_load = True

    def __post_init__(self) -> None:
        check_sign("load_dependent", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return self.limit(theta, x, memory) * sign + theta[..., 2] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = smooth_sign(x.w, self.width, self.shape) + zero
        return xp.stack([sign, x.load * sign, x.w + zero], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] + theta[..., 1] * x.load + 0.0 * x.w


@dataclass(frozen=True)
class LoadDependentStribeck(Law):
    """Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2) + c load) sgn(w) + viscous w.

    c is the `load_coefficient`, as in `LoadDependent`.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = (
        "coulomb",
        "peak",
        "stribeck_velocity",
        "load_coefficient",
        "viscous",
    )
    units: ClassVar[tuple[str, ...]] = ("N m", "N m", "rad/s", "N m/N", "N m s/rad")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL, LEVEL, VELOCITY, LEVEL, LEVEL)
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, ws, 0.0, 0.0) for ws in VELOCITIES
    )
    uses_load = True

    def __post_init__(self) -> None:
        check_sign("load_dependent", self.width, self.shape)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        sign = smooth_sign(x.w, self.width, self.shape)
        return (level(theta, x.w) + theta[..., 3] * x.load) * sign + theta[..., 4] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        ws = theta[..., 2]
        left = stribeck_factor(x.w, ws)
        zero = 0.0 * left
        sign = smooth_sign(x.w, self.width, self.shape) + zero
        by_ws = theta[..., 1] * sign * left * (2.0 * x.w**2 / ws**3)
        return xp.stack([sign, sign * left, by_ws, x.load * sign, x.w + zero], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] + theta[..., 1] + theta[..., 3] * x.load + 0.0 * x.w
