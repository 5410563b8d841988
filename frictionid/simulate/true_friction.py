"""True friction of the simulated rig, with real stiction, to judge identified friction against.

All have the same kind of steady-state curve, per joint

    Tf(w) = (coulomb + peak exp(-(w / ws)^2)) sgn(w) + viscous w   [Armstrong1994]

and differ while w changes. Memory-free friction and film lag are set-valued at rest: a joint at
w = 0 takes any torque up to the level. The integrator gives each joint a *mode*, +1 or -1 where it
slips that way and 0 where it sticks, within which all equations are smooth. LuGre friction is
single-valued and its joints never stick, but |w| has a kink at zero.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from frictionid.config import NotNegative, Positive, check_settings
from frictionid.data.signals import Array
from frictionid.errors import InputError

# One number per joint.
Numbers = tuple[NotNegative, ...]
PositiveNumbers = tuple[Positive, ...]


@dataclass(frozen=True)
class Curve:
    """Steady-state friction curve; one number per joint in each field.

    Without a peak: Coulomb and viscous friction.

    Parameters
    ----------
    coulomb_positive, coulomb_negative : tuple of float [N m]
        Sliding level for w > 0 and w < 0.
    viscous : tuple of float [N m s/rad]
    peak_positive, peak_negative : tuple of float [N m]
        Break-away minus sliding level; zero by default.
    stribeck_velocity : tuple of float [rad/s]

    Examples
    --------
    >>> curve = Curve((0.05,), (0.05,), viscous=(0.001,), peak_positive=(0.03,))
    >>> [round(float(curve.torque(np.array([w]), np.sign([w]))[0]), 4) for w in (1e-9, 10.0, -10.0)]
    [0.08, 0.06, -0.06]
    """

    coulomb_positive: Numbers
    coulomb_negative: Numbers
    viscous: Numbers
    peak_positive: Numbers = ()
    peak_negative: Numbers = ()
    stribeck_velocity: PositiveNumbers = ()

    def __post_init__(self) -> None:
        n = len(self.coulomb_positive)
        for name, default in (
            ("peak_positive", 0.0),
            ("peak_negative", 0.0),
            ("stribeck_velocity", 1.0),
        ):
            if not getattr(self, name):
                object.__setattr__(self, name, (default,) * n)
        check_joints(self, n, [field.name for field in fields(self)])

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.coulomb_positive)

    @cached_property
    def _arrays(self) -> tuple[Array, ...]:
        return tuple(np.array(getattr(self, field.name)) for field in fields(self))

    def level(self, speed: Array, side: Array) -> Array:
        """Friction level without the viscous term at a speed in the direction of `side` [N m]."""
        return level_of(self._arrays, speed, side)

    def torque(self, w: Array, side: Array) -> Array:
        """Friction torque [N m] at w for the direction `side` (+1, -1 or 0), shape (..., n)."""
        return side * self.level(w, side) + self._arrays[2] * w

    def table(self) -> dict[str, Any]:
        """Fields by name, as lists."""
        return {field.name: list(getattr(self, field.name)) for field in fields(self)}


def level_of(numbers: Sequence[Array], speed: Array, side: Array) -> Array:
    """Level [N m] of curves whose fields are these numbers, at a speed in the direction of side."""
    positive, negative, _, peak_positive, peak_negative, width = numbers
    forward = side >= 0
    peak = np.where(forward, peak_positive, peak_negative)
    return np.where(forward, positive, negative) + peak * np.exp(-((speed / width) ** 2))


class TrueFriction:
    """Friction of all joints with one memory state z per joint; arrays have shape (..., n).

    By default it follows its curve and remembers nothing.

    Attributes
    ----------
    curve : Curve
    kind : str
        Its name in files.
    sticks : bool
        Whether friction is set-valued at w = 0.
    per_joint : tuple of str
        Fields that have one number for each joint.
    """

    curve: Curve
    kind: str
    sticks: ClassVar[bool] = True
    per_joint: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        check_joints(self, self.curve.n, self.per_joint)

    @cached_property
    def _arrays(self) -> tuple[Array, ...]:
        """The fields with one number for each joint, and the viscous coefficients, (n,) each."""
        return (
            *(np.array(getattr(self, name)) for name in self.per_joint),
            np.array(self.curve.viscous),
        )

    def start(self, w: Array) -> Array:
        """Memory after a long time at the velocity w."""
        return np.zeros_like(w)

    def torque(self, w: Array, z: Array, mode: Array) -> Array:  # noqa: ARG002
        """Friction torque [N m] in a mode, extended smoothly beyond w = 0.

        At w = 0 the modes +1 and -1 give both ends of the break-away band.
        """
        return self.curve.torque(w, mode)

    def rate(self, w: Array, z: Array, mode: Array) -> Array:  # noqa: ARG002
        """dz/dt in a mode."""
        return np.zeros_like(w)

    def table(self) -> dict[str, Any]:
        """The [truth] table of a data set with this friction."""
        lists = {name: list(getattr(self, name)) for name in self.per_joint}
        return {"kind": self.kind, **self.curve.table(), **lists}


@dataclass(frozen=True)
class Stribeck(TrueFriction):
    """Memory-free friction: the steady-state curve, set-valued at rest.

    Examples
    --------
    >>> Stribeck(Curve((0.1,), (0.1,), (0.0,))).sticks
    True
    """

    curve: Curve
    kind: Literal["stribeck"] = "stribeck"


@dataclass(frozen=True)
class FilmLag(TrueFriction):
    """Frictional lag: the lubricating film follows the speed with a lag, the torque without.

    dz/dt = (|w| - z) / lag,   Tf = level(z) sgn(w) + viscous w

    Set-valued at rest, with the level of the current z [Olsson1998].

    Parameters
    ----------
    curve : Curve
    lag : tuple of float [s]
        One time constant per joint.
    """

    curve: Curve
    lag: PositiveNumbers
    kind: Literal["film_lag"] = "film_lag"
    per_joint = ("lag",)

    def start(self, w: Array) -> Array:
        return np.abs(w)

    def torque(self, w: Array, z: Array, mode: Array) -> Array:
        return mode * self.curve.level(z, mode) + self._arrays[1] * w

    def rate(self, w: Array, z: Array, mode: Array) -> Array:
        return (mode * w - z) / self._arrays[0]


@dataclass(frozen=True)
class LuGre(TrueFriction):
    """LuGre friction: a bristle of stiffness s0 and deflection z that slides at the curve's level.

    dz/dt = w - s0 |w| z / level(w),   Tf = s0 z + s1(w) dz/dt + viscous w [CanudasDeWit1995]

    The damping s1(w) = bristle_damping exp(-(w / damping_velocity)^2) decreases with the speed:
    with constant damping LuGre friction is not passive. With x = s0 z and v = dz/dt,

    w Tf - d(s0 z^2 / 2)/dt = |w|/level x^2 + s1 |w|/level x v + s1 v^2 + viscous w^2

    is never negative if s1(w) |w| <= 4 level(w). The largest s1 |w| is bristle_damping
    damping_velocity / sqrt(2 e), which is compared with the smallest level.

    Parameters
    ----------
    curve : Curve
    bristle_stiffness : tuple of float [N m/rad]
    bristle_damping : tuple of float [N m s/rad]
    damping_velocity : tuple of float [rad/s]

    Raises
    ------
    InputError
        Where the damping is so large that the friction would not be passive.
    """

    curve: Curve
    bristle_stiffness: PositiveNumbers
    bristle_damping: Numbers
    damping_velocity: PositiveNumbers
    kind: Literal["lugre"] = "lugre"
    sticks = False
    per_joint = ("bristle_stiffness", "bristle_damping", "damping_velocity")

    def __post_init__(self) -> None:
        super().__post_init__()
        for joint in range(self.curve.n):
            damping, width = self.bristle_damping[joint], self.damping_velocity[joint]
            most = damping * width / math.sqrt(2 * math.e)
            least = min(self.curve.coulomb_positive[joint], self.curve.coulomb_negative[joint])
            if not 0 < least or most > 4 * least:
                raise InputError(
                    f"joint {joint + 1}: LuGre is passive if bristle_damping * "
                    f"damping_velocity / 2.33 = {most:.3g} N m is at most 4 coulomb = "
                    f"{4 * least:.3g} N m; lower bristle_damping or damping_velocity"
                )

    def start(self, w: Array) -> Array:
        side = np.sign(w)
        return side * self.curve.level(w, side) / self._arrays[0]

    def torque(self, w: Array, z: Array, mode: Array) -> Array:
        stiffness, damping, width, viscous = self._arrays
        fading = damping * np.exp(-((w / width) ** 2))
        return stiffness * z + fading * self.rate(w, z, mode) + viscous * w

    def rate(self, w: Array, z: Array, mode: Array) -> Array:
        return w - self._arrays[0] * mode * w * z / self.curve.level(w, mode)


@dataclass(frozen=True)
class LoadFriction(TrueFriction):
    """Memory-free friction whose level grows with the load, set-valued at rest.

        Tf = (level(w) + bearing N + |motor u - external te| + left (|peak_motor u - peak_external
             te| + square)) sgn(w) + viscous w,    left = exp(-(w / stribeck_velocity)^2)

    with the bearing force N of friction-free motion, the motor's torque u and that of gravity on a
    pendulum, te = -moment sin q. `square` is quadratic_external te^2 where |u| > |te|, otherwise
    quadratic_motor u^2, and only where u and te oppose each other [Duclusaud2025].

    Parameters
    ----------
    curve : Curve
        Friction without load.
    bearing : tuple of float [N m/N]
    motor, external, peak_motor, peak_external : tuple of float
        One coefficient per joint, zero by default.
    quadratic_motor, quadratic_external : tuple of float [1/(N m)]
    moment : float [N m]
        Of the pendulum that each joint carries.
    """

    curve: Curve
    bearing: Numbers = ()
    motor: Numbers = ()
    external: Numbers = ()
    peak_motor: Numbers = ()
    peak_external: Numbers = ()
    quadratic_motor: Numbers = ()
    quadratic_external: Numbers = ()
    moment: NotNegative = 0.0
    kind: Literal["load"] = "load"
    per_joint = (
        *("bearing", "motor", "external", "peak_motor", "peak_external"),
        *("quadratic_motor", "quadratic_external"),
    )

    def __post_init__(self) -> None:
        for name in self.per_joint:
            if not getattr(self, name):
                object.__setattr__(self, name, (0.0,) * self.curve.n)
        super().__post_init__()

    def loaded_level(self, w: Array, N: Array, u: Array, te: Array) -> Array:
        """What the load adds to the level [N m] at velocities w, (..., n)."""
        bearing, motor, external, *peaks, of_motor, of_external, _ = self._arrays
        peak_motor, peak_external = peaks
        square = np.where(np.abs(u) > np.abs(te), of_external * te**2, of_motor * u**2)
        peak = np.abs(peak_motor * u - peak_external * te) + np.where(u * te < 0, square, 0.0)
        left = np.exp(-((w / np.array(self.curve.stribeck_velocity)) ** 2))
        return bearing * N + np.abs(motor * u - external * te) + left * peak

    def table(self) -> dict[str, Any]:
        return {**super().table(), "moment": self.moment}


def check_joints(settings: Any, n: int, names: Sequence[str]) -> None:
    """Raise InputError for wrong settings, or unless these fields have one number per joint."""
    check_settings(settings)
    for name in names:
        values = getattr(settings, name)
        if len(values) != n or n == 0:
            raise InputError(f"{name} = {list(values)} needs one number for each of {n} joints")
