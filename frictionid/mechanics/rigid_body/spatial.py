"""Spatial vectors of rigid bodies in the frame of the base, about its origin [Featherstone2008].

Motions x = (angular, linear velocity of the point at the origin), forces f = (moment about the
origin, force). An inertia is its ten parameters (m, m c, Ixx, Ixy, Ixz, Iyy, Iyz, Izz), about the
origin as well. All functions are of one sample; vectors are six numbers.
"""

from __future__ import annotations

from typing import Any

from frictionid.programs.loops import inlined


@inlined
def dot(x: Any, f: Any) -> float:
    """Power of a force on a motion, x' f."""
    return x[0] * f[0] + x[1] * f[1] + x[2] * f[2] + x[3] * f[3] + x[4] * f[4] + x[5] * f[5]


@inlined
def cross_motion(v: Any, x: Any) -> Any:
    """Change of a motion x that is carried along by v: v x x."""
    return (
        v[1] * x[2] - v[2] * x[1],
        v[2] * x[0] - v[0] * x[2],
        v[0] * x[1] - v[1] * x[0],
        v[1] * x[5] - v[2] * x[4] + v[4] * x[2] - v[5] * x[1],
        v[2] * x[3] - v[0] * x[5] + v[5] * x[0] - v[3] * x[2],
        v[0] * x[4] - v[1] * x[3] + v[3] * x[1] - v[4] * x[0],
    )


@inlined
def cross_force(v: Any, f: Any) -> Any:
    """Change of a force f that is carried along by v: v x* f."""
    return (
        v[1] * f[2] - v[2] * f[1] + v[4] * f[5] - v[5] * f[4],
        v[2] * f[0] - v[0] * f[2] + v[5] * f[3] - v[3] * f[5],
        v[0] * f[1] - v[1] * f[0] + v[3] * f[4] - v[4] * f[3],
        v[1] * f[5] - v[2] * f[4],
        v[2] * f[3] - v[0] * f[5],
        v[0] * f[4] - v[1] * f[3],
    )


@inlined
def momentum(inertia: Any, x: Any) -> Any:
    """Momentum of an inertia at the velocity x: I x."""
    m, h0, h1, h2 = inertia[0], inertia[1], inertia[2], inertia[3]
    return (
        inertia[4] * x[0] + inertia[5] * x[1] + inertia[6] * x[2] + h1 * x[5] - h2 * x[4],
        inertia[5] * x[0] + inertia[7] * x[1] + inertia[8] * x[2] + h2 * x[3] - h0 * x[5],
        inertia[6] * x[0] + inertia[8] * x[1] + inertia[9] * x[2] + h0 * x[4] - h1 * x[3],
        m * x[3] - h1 * x[2] + h2 * x[1],
        m * x[4] - h2 * x[0] + h0 * x[2],
        m * x[5] - h0 * x[1] + h1 * x[0],
    )
