"""Smooth stand-ins for sgn(w), with their width written in rad/s."""

from __future__ import annotations

import math

from frictionid.arrays import Array, namespace


def smooth_sign(w: Array, width: float, shape: str = "tanh") -> Array:
    """sgn(w) smoothed over `width` [rad/s]: tanh(w/width), or (2/pi) arctan(w/width).

    Published models often write cf arctan(100 w): their Coulomb level is cf pi/2, not cf.

    Raises
    ------
    ValueError
        For another shape.

    >>> import numpy as np
    >>> smooth_sign(np.array([-1.0, 0.0, 1.0]), 0.01)
    array([-1.,  0.,  1.])
    """
    xp = namespace(w)
    if shape == "tanh":
        return xp.tanh(w / width)
    if shape == "arctan":
        return xp.atan(w / width) * (2.0 / math.pi)
    raise ValueError(f"the shape of a smooth sign must be 'tanh' or 'arctan', got {shape!r}")
