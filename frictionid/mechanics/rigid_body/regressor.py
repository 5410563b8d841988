"""Regressor of the torques of a motion: how each inertial parameter enters [Atkeson1986]."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.compiled import compiled, inlined
from frictionid.mechanics.rigid_body.spatial import dot

_FIRST = np.array([0, 0, 0, 1, 1, 2])  # rows and columns of Ixx, Ixy, Ixz, Iyy, Iyz, Izz
_SECOND = np.array([0, 1, 2, 1, 2, 2])


@inlined
def _cross(x: Any, y: Any, out: Any) -> None:
    out[0] = x[1] * y[2] - x[2] * y[1]
    out[1] = x[2] * y[0] - x[0] * y[2]
    out[2] = x[0] * y[1] - x[1] * y[0]


@inlined
def _of_first_moment(e: Any, rate: Any, omega: Any, scratch: Any, out: Any) -> None:
    """Acceleration of a point at e against the body's origin: rate x e + omega x (omega x e)."""
    _cross(omega, e, scratch)
    _cross(omega, scratch, out)
    _cross(rate, e, scratch)
    for c in range(3):
        out[c] += scratch[c]


@inlined
def _wrench(kind: int, R: Any, o: Any, v: Any, a: Any, work: Any, out: Any) -> None:
    """Force about the base's origin (6,) that a unit of one of a body's ten parameters needs."""
    omega, rate = v[:3], a[:3]
    s, point, e, force = work[0], work[1], work[2], work[3]
    # acceleration of the body's origin less gravity
    _of_first_moment(o, rate, omega, s, point)
    _cross(omega, v[3:], s)
    for c in range(3):
        point[c] += a[3 + c] + s[c]
    if kind == 0:
        _cross(o, point, out[:3])
        out[3:] = point
    elif kind < 4:
        e[:] = R[:, kind - 1]
        _of_first_moment(e, rate, omega, s, force)
        _cross(o, force, out[:3])
        _cross(e, point, s)
        for c in range(3):
            out[c] += s[c]
            out[3 + c] = force[c]
    else:
        i, j = _FIRST[kind - 4], _SECOND[kind - 4]
        half = 0.5 if i == j else 1.0
        first, second = R[:, i], R[:, j]
        wi = first[0] * omega[0] + first[1] * omega[1] + first[2] * omega[2]
        wj = second[0] * omega[0] + second[1] * omega[1] + second[2] * omega[2]
        ai = first[0] * rate[0] + first[1] * rate[1] + first[2] * rate[2]
        aj = second[0] * rate[0] + second[1] * rate[1] + second[2] * rate[2]
        for c in range(3):
            e[c] = half * (first[c] * wj + second[c] * wi)
        _cross(omega, e, out[:3])
        for c in range(3):
            out[c] += half * (first[c] * aj + second[c] * ai)
        out[3:] = 0.0


@compiled
def torque_regressor(
    parent: Array, R: Array, o: Array, S: Array, v: Array, a: Array, columns: Array
) -> Array:
    """Torques (K, n, C) of a motion with one unit parameter each.

    columns : array of int, shape (C,), of the 10 n parameters of all bodies; the other arguments
        as in `kinematics` and `rnea`
    """
    K, n = S.shape[0], S.shape[1]
    out, work, wrench = np.zeros((K, n, len(columns))), np.empty((4, 3)), np.empty(6)
    for k in range(K):
        for c in range(len(columns)):
            body = columns[c] // 10
            _wrench(columns[c] % 10, R[k, body], o[k, body], v[k, body], a[k, body], work, wrench)
            j = body
            while j >= 0:
                out[k, j, c] = dot(S[k, j], wrench)
                j = parent[j]
    return out
