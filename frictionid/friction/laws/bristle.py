"""Bristles between two surfaces: before a joint slips they deflect by z [rad], like a spring.

dz/dt = w - |w| z / steady

with `steady` [rad] their deflection in steady sliding [CanudasDeWit1995].
"""

from __future__ import annotations

from frictionid.arrays import Array, namespace


def bristle_relaxation(w: Array, steady: Array, dt: Array) -> tuple[Array, Array]:
    """Where bristles bend at the velocity w, and the share of the way that is left after dt.

    The exact solution: it neither overshoots nor limits the step.

    >>> import numpy as np
    >>> target, left = bristle_relaxation(np.array([1.0]), np.array([0.01]), np.array([0.01]))
    >>> target, left.round(3)
    (array([0.01]), array([0.368]))
    """
    xp = namespace(w, steady)
    return xp.sign(w) * steady, xp.exp(-xp.abs(w) * dt / steady)


def bristle_rate(z: Array, w: Array, steady: Array) -> Array:
    """dz/dt at the velocity w [rad/s].

    >>> import numpy as np
    >>> bristle_rate(np.array([0.0, 0.01]), np.array([1.0, 1.0]), np.array([0.01, 0.01]))
    array([1., 0.])
    """
    return w - namespace(w).abs(w) * z / steady
