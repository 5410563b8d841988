"""Stick and slip of all joints at one instant: accelerations in a mode, and the next mode.

M dw/dt = h + B u - Tf,   Tf in the break-away band where w = 0

A mode has one entry per joint: +1 or -1 slips that way, 0 sticks. Arrays have a leading axis of
recordings, shape (R, n).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.arrays import solve
from frictionid.config import NotNegative
from frictionid.data.signals import Array
from frictionid.mechanics import Mechanism
from frictionid.simulate.true_friction import Curve, MemoryFree, Numbers, TrueFriction, check_joints

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


@dataclass(frozen=True)
class TrueSystem:
    """A mechanism with its true base parameters p, shape (nb,), and its true friction.

    parameters : the true physical ones, which bearing forces need
    """

    mechanism: Mechanism
    p: Array
    friction: TrueFriction
    parameters: Mapping[str, float] = field(default_factory=dict)

    def combinations(self, rests: NDArray[np.bool_]) -> Array:
        """All modes (C, n) of the joints that rest (n,), zero elsewhere.

        C = 3^k of k such joints, or 2^k without stick; sticking first: it wins ties.
        """
        each = (0.0, 1.0, -1.0) if self.friction.sticks else (1.0, -1.0)
        choices = [each if rest else (0.0,) for rest in rests]
        return np.array(list(product(*choices)))

    def torque(self, y: Array, u: Array, mode: Array, w: Array | None = None) -> Array:
        """Friction torque (..., n) [N m] in a mode at states y (3, R, n) under motor torques u.

        w : (..., n), velocities of the joints in place of those of y, under the same load
        """
        w = y[1] if w is None else w
        Tf = self.friction.torque(w, y[2], mode)
        if not isinstance(self.friction, LoadFriction):
            return Tf
        bearing = self.mechanism.load(self.parameters, y[0], y[1], u)
        load = Load(bearing, u, -self.friction.moment * np.sin(y[0]))
        loaded: Array = Tf + mode * self.friction.loaded_level(w, load)
        return loaded


def accelerations(M: Array, f: Array, Tf: Array, slips: NDArray[np.bool_]) -> Array:
    """dw/dt of slipping joints while the others stick, shape (..., n) [rad/s^2].

    Rows and columns of sticking joints are replaced by those of the identity, so that their
    acceleration is exactly zero; their holding torque is f - M dw/dt.

    Parameters
    ----------
    M : array, shape (..., n, n) [kg m^2]
    f, Tf : array, shape (..., n) [N m]
        All torques but friction, and friction of the slipping joints.
    slips : array of bool, shape (..., n)

    Examples
    --------
    >>> M, f = np.array([[2.0, 1.0], [1.0, 1.0]]), np.array([3.0, 0.5])
    >>> accelerations(M, f, 0.0 * f, np.array([True, False]))
    array([1.5, 0. ])
    """
    if slips.all():
        return np.asarray(solve(M, f - Tf))
    both = slips[..., :, None] & slips[..., None, :]
    a: Array = solve(np.where(both, M, np.eye(M.shape[-1])), np.where(slips, f - Tf, 0.0))
    return a


def margins(system: TrueSystem, y: Array, u: Array, mode: Array) -> Array:
    """Margin of each joint before its mode ends, negative where it has ended; shape (R, n).

    The velocity in the direction of slip [rad/s], or for a sticking joint the distance of its
    holding torque to the break-away level [N m].

    Parameters
    ----------
    y : array, shape (3, R, n)
        Angles, velocities and friction memory.
    u : array, shape (R, n) [N m]
    mode : array, shape (R, n)
    """
    margin: Array = mode * y[1]
    sticks = (mode == 0).any(axis=-1)
    if sticks.any():
        held = _hold_margins(system, y[:, sticks], u[sticks], mode[sticks])
        margin[sticks] = np.where(mode[sticks] == 0, held, margin[sticks])
    return margin


def next_modes(system: TrueSystem, y: Array, u: Array) -> Array:
    """Consistent modes at a state, shape (R, n).

    A moving joint slips in its direction. For joints at rest all combinations of sticking and
    slipping are tried: a joint may stick if its holding torque lies within the break-away band, and
    slip only in the direction of its acceleration. Apart from ties exactly one combination is
    consistent, because M is positive definite and break-away equals the level at the onset of slip.
    With rounding, the combination with the smallest violation is taken.

    Parameters
    ----------
    y : array, shape (3, R, n)
    u : array, shape (R, n) [N m]
    """
    q, w, _ = y
    M, h = system.mechanism.dynamics(system.p, q, w)
    f = h + u
    rests = w == 0
    mode = np.where(rests, system.combinations(rests.any(axis=0))[:, None, :], np.sign(w))
    a = accelerations(M, f, system.torque(y, u, mode), mode != 0)
    hold = f - (M * a[..., None, :]).sum(-1)
    sticking = -_within(system, y, u, hold)
    # both violations as torques
    slipping = -mode * a * np.diagonal(M, axis1=-2, axis2=-1)
    wrong = np.where(rests, np.where(mode == 0, sticking, slipping), 0.0)
    best = np.maximum(wrong, 0.0).max(axis=-1).argmin(axis=0)
    chosen: Array = mode[best, np.arange(len(best))]
    return chosen


def _hold_margins(system: TrueSystem, y: Array, u: Array, mode: Array) -> Array:
    M, h = system.mechanism.dynamics(system.p, y[0], y[1])
    f = h + u
    a = accelerations(M, f, system.torque(y, u, mode), mode != 0)
    return _within(system, y, u, f - (M * a[..., None, :]).sum(-1))


def _within(system: TrueSystem, y: Array, u: Array, hold: Array) -> Array:
    """Distance of a holding torque to the nearer end of the break-away band, negative outside."""
    rest, one = np.zeros_like(y[1]), np.ones_like(y[1])
    upper = system.torque(y, u, one, rest)
    lower = system.torque(y, u, -one, rest)
    within: Array = np.minimum(upper - hold, hold - lower)
    return within
