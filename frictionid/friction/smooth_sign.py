"""Smooth stand-ins for sgn(w), with their width in rad/s."""

from __future__ import annotations

import math

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError

SHAPES = ("tanh", "arctan")


def smooth_sign(w: Array, width: float, shape: str = "tanh") -> Array:
    """sgn(w) smoothed over `width`: tanh(w/width), or (2/pi) arctan(w/width).

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


def check_smoothing(law: str, width: float, shape: str) -> None:
    """Refuse settings of a smooth sign that mean nothing.

    Raises
    ------
    InputError
        Naming the law, the setting and its value.

    >>> check_smoothing("Stribeck", 0.0, "tanh")
    Traceback (most recent call last):
    frictionid.errors.InputError: Stribeck: width = 0.0 rad/s must be positive and finite
    """
    if not 0 < width < math.inf:
        raise InputError(f"{law}: width = {width} rad/s must be positive and finite")
    if shape not in SHAPES:
        raise InputError(f"{law}: shape = {shape!r} is unknown; known are {', '.join(SHAPES)}")
