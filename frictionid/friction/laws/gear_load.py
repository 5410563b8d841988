"""Friction of a gear under load: from the motor's side and from outside, with speed and squares.

A gear rubs the more, the more torque it transmits, by tooth flanks that slide under pressure. What
presses them is the motor's torque u on one side and the external torque te on the other; what te is
the mechanism says: on the joint of a pendulum it is the torque of gravity, -m g l sin q, no bearing
force. These are the extended friction models M3 to M6 of servos [Duclusaud2025].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from frictionid.arrays import Array, namespace
from frictionid.config import NotNegative
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import COARSE_VELOCITIES, LEVEL, VELOCITY
from frictionid.friction.laws.motor_load import SHARE
from frictionid.friction.smooth_sign import smooth_sign

_EXPONENT = (0.5, 10.0)
_SMALLEST = 1e-300


@dataclass(frozen=True)
class GearLoad(Law):
    """Tf = (level + left peaks) sgn(w) + viscous w, the model M6 of servos [Duclusaud2025].

        level = coulomb + |motor u - external te|
        left  = exp(-(|w|/stribeck_velocity)^exponent)
        peaks = peak + |peak_motor u - peak_external te| + square
        square = quadratic_external te^2 where |u| > |te|, else quadratic_motor u^2,
                 and only where u and te oppose each other

    with te = -moment sin q, `moment` = m g l [N m] of the pendulum that the joint carries, in all
    recordings the same; 0 is a gear that nothing but its motor loads. Without squares this is M5;
    with equal coefficients of u and te, M4; without peaks M3, or M1 without any load. sgn is
    smoothed over `width`.
    """

    moment: NotNegative
    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = (
        *("coulomb", "viscous", "motor", "external"),
        *("peak", "peak_motor", "peak_external", "quadratic_motor", "quadratic_external"),
        *("stribeck_velocity", "exponent"),
    )
    units: ClassVar[tuple[str, ...]] = (
        *("N m", "N m s/rad", "1", "1"),
        *("N m", "1", "1", "1/(N m)", "1/(N m)"),
        *("rad/s", "1"),
    )
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (
        *(LEVEL, LEVEL, SHARE, SHARE),
        *(LEVEL, SHARE, SHARE, LEVEL, LEVEL),
        *(VELOCITY, _EXPONENT),
    )
    # not zero: there |motor u - external te| has no slope
    initial: ClassVar[tuple[tuple[float, ...], ...]] = tuple(
        (0.0, 0.0, 0.2, 0.05, 0.0, 0.05, 0.05, 0.0, 0.0, ws, 2.0) for ws in COARSE_VELOCITIES
    )

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        xp = namespace(theta, x.w)
        left = xp.exp(-(self._speed(theta, x) ** theta[..., 10]))
        level = self._level(theta, x) + left * self._peaks(theta, x)
        return level * smooth_sign(x.w, self.width, self.shape) + theta[..., 1] * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        xp = namespace(theta, x.w)
        speed, exponent = self._speed(theta, x), theta[..., 10]
        power = speed**exponent
        left = xp.exp(-power)
        zero = 0.0 * left
        sign = smooth_sign(x.w, self.width, self.shape) + zero
        te = self._external(x)
        by_motor, by_external = _size_slopes(theta[..., 2], theta[..., 3], x.u, te)
        peak_motor, peak_external = _size_slopes(theta[..., 5], theta[..., 6], x.u, te)
        square_motor, square_external = _squares(x.u, te)
        falls = sign * left * power * self._peaks(theta, x)
        of_peaks = (
            one * left for one in (peak_motor, peak_external, square_motor, square_external)
        )
        columns = [
            *(sign, x.w + zero, by_motor * sign, by_external * sign, left * sign),
            *(column * sign for column in of_peaks),
            *(falls * exponent / theta[..., 9], -falls * xp.log(speed)),
        ]
        return xp.stack(columns, axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._level(theta, x) + self._peaks(theta, x) + 0.0 * x.w

    def _external(self, x: Inputs) -> Array:
        return -self.moment * namespace(x.q).sin(x.q)

    def _level(self, theta: Array, x: Inputs) -> Array:
        return theta[..., 0] + _size(theta[..., 2] * x.u - theta[..., 3] * self._external(x))

    def _peaks(self, theta: Array, x: Inputs) -> Array:
        te = self._external(x)
        by_motor, by_external = _squares(x.u, te)
        square = theta[..., 7] * by_motor + theta[..., 8] * by_external
        return theta[..., 4] + _size(theta[..., 5] * x.u - theta[..., 6] * te) + square

    def _speed(self, theta: Array, x: Inputs) -> Array:
        """Speed in Stribeck velocities; hardly above zero at rest, where it has a logarithm."""
        xp = namespace(theta, x.w)
        return (xp.abs(x.w) + _SMALLEST) / theta[..., 9]


def _size(x: Array) -> Array:
    """|x|, written so that complex steps pass through it."""
    return namespace(x).where(x < 0.0, -x, x)


def _size_slopes(motor: Array, external: Array, u: Array, te: Array) -> tuple[Array, Array]:
    """Slopes of |motor u - external te| in both coefficients."""
    xp = namespace(motor, u)
    inner = motor * u - external * te
    sign = xp.where(inner < 0.0, -1.0, 1.0)
    return sign * u, -sign * te


def _squares(u: Array, te: Array) -> tuple[Array, Array]:
    """u^2 and te^2 where they count: the smaller one's, and only where u and te are opposed."""
    xp = namespace(u, te)
    opposed = xp.where(u * te < 0.0, 1.0, 0.0)
    motor_wins = xp.abs(u) > xp.abs(te)
    zero = 0.0 * u * te
    return (
        opposed * xp.where(motor_wins, zero, u**2),
        opposed * xp.where(motor_wins, te**2, zero),
    )
