"""True friction that grows with the load of a joint: bearings and gears."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from frictionid.config import NotNegative
from frictionid.data.signals import Array
from frictionid.simulate.true_friction import Curve, MemoryFree, Numbers, check_joints

_SHARES = ("bearing", "motor", "external", "peak_motor", "peak_external")
_SQUARES = ("quadratic_motor", "quadratic_external")


class Load(NamedTuple):
    """What loads the joints, (..., n) each: bearing force [N], motor and external torque [N m]."""

    bearing: Array
    motor: Array
    external: Array


@dataclass(frozen=True)
class LoadFriction(MemoryFree):
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
    sticks: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in (*_SHARES, *_SQUARES):
            if not getattr(self, name):
                object.__setattr__(self, name, (0.0,) * self.curve.n)
        check_joints(self, self.curve.n, [*_SHARES, *_SQUARES])

    @cached_property
    def _coefficients(self) -> tuple[Array, ...]:
        return tuple(np.array(getattr(self, name)) for name in (*_SHARES, *_SQUARES))

    def loaded_level(self, w: Array, load: Load) -> Array:
        """What the load adds to the level [N m] at velocities w, (..., n)."""
        bearing, motor, external, peak_motor, peak_external, *squares = self._coefficients
        N, u, te = load
        of_motor, of_external = squares
        square = np.where(np.abs(u) > np.abs(te), of_external * te**2, of_motor * u**2)
        peak = np.abs(peak_motor * u - peak_external * te) + np.where(u * te < 0, square, 0.0)
        left = np.exp(-((w / np.array(self.curve.stribeck_velocity)) ** 2))
        level: Array = bearing * N + np.abs(motor * u - external * te) + left * peak
        return level

    def table(self) -> dict[str, Any]:
        own = {name: list(getattr(self, name)) for name in (*_SHARES, *_SQUARES)}
        return {"kind": self.kind, **self.curve.table(), **own, "moment": self.moment}
