"""Regressor of the torques of a motion: how each inertial parameter enters [Atkeson1986]."""

from __future__ import annotations

from typing import Any

from frictionid.mechanics.rigid_body.spatial import dot
from frictionid.programs.loops import inlined


@inlined
def _cross(x: Any, y: Any) -> Any:
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@inlined
def _dot(x: Any, y: Any) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def _relative(e: Any, rate: Any, omega: Any) -> Any:
    """Acceleration of a point at e against its body's origin: rate x e + omega x (omega x e)."""
    first, second = _cross(rate, e), _cross(omega, _cross(omega, e))
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@inlined
def _wrenches(R: Any, o: Any, v: Any, a: Any, out: Any) -> None:
    """Forces about the base's origin (10, 6) that units of a body's ten parameters need."""
    omega, rate = (v[0], v[1], v[2]), (a[0], a[1], a[2])
    turned, own = _cross(omega, (v[3], v[4], v[5])), _relative(o, rate, omega)
    # acceleration of the body's origin less gravity
    point = (a[3] + turned[0] + own[0], a[4] + turned[1] + own[1], a[5] + turned[2] + own[2])
    moment = _cross(o, point)
    for c in range(3):
        out[0, c], out[0, 3 + c] = moment[c], point[c]
    for axis in range(3):
        e = (R[0, axis], R[1, axis], R[2, axis])
        force = _relative(e, rate, omega)
        first, second = _cross(o, force), _cross(e, point)
        for c in range(3):
            out[1 + axis, c], out[1 + axis, 3 + c] = first[c] + second[c], force[c]
    k = 4
    for i in range(3):
        x = (R[0, i], R[1, i], R[2, i])
        for j in range(i, 3):
            y = (R[0, j], R[1, j], R[2, j])
            half = 0.5 if i == j else 1.0
            wx, wy = half * _dot(x, omega), half * _dot(y, omega)
            ax, ay = half * _dot(x, rate), half * _dot(y, rate)
            spin = (x[0] * wy + y[0] * wx, x[1] * wy + y[1] * wx, x[2] * wy + y[2] * wx)
            gyro = _cross(omega, spin)
            for c in range(3):
                out[k, c], out[k, 3 + c] = x[c] * ay + y[c] * ax + gyro[c], 0.0
            k += 1


@inlined
def torque_regressor(
    parent: Any, frames: Any, S: Any, v: Any, a: Any, columns: Any, wrench: Any, out: Any
) -> None:
    """Write the torques (n, C) of a motion with one unit parameter each.

    frames : R and o of the bodies, see `kinematics.placements`
    columns : array of int, shape (C,), in order, of the 10 n parameters of all bodies
    wrench : scratch (10, 6)
    """
    R, o = frames
    last = -1
    for c in range(len(columns)):
        body = columns[c] // 10
        if body != last:
            _wrenches(R[body], o[body], v[body], a[body], wrench)
            last = body
        for i in range(len(parent)):
            out[i, c] = 0.0
        j = body
        while j >= 0:
            out[j, c] = dot(S[j], wrench[columns[c] % 10])
            j = parent[j]
