"""Bristles between two surfaces: before a joint slips they bend by z [rad], like a spring.

dz/dt = w - |w| z / bend

with `bend` [rad] their deflection in steady sliding [CanudasDeWit1995].
"""

from __future__ import annotations

from frictionid.arrays import Array, namespace


def bristle_state(z: Array, w: Array, bend: Array, dt: Array) -> Array:
    """Bend z after dt at the velocity w, exactly; it neither overshoots nor limits the step.

    >>> import numpy as np
    >>> bristle_state(np.array([0.0]), np.array([1.0]), np.array([0.01]), np.array([0.01])).round(5)
    array([0.00632])
    """
    xp = namespace(z, w, bend)
    settled = xp.sign(w) * bend
    return settled + (z - settled) * xp.exp(-xp.abs(w) * dt / bend)


def rate(z: Array, w: Array, bend: Array) -> Array:
    """dz/dt at the velocity w [rad/s].

    >>> import numpy as np
    >>> rate(np.array([0.0, 0.01]), np.array([1.0, 1.0]), np.array([0.01, 0.01]))
    array([1., 0.])
    """
    return w - namespace(w).abs(w) * z / bend
