"""The motion of a base that carries a mechanism, as its equations of motion take it."""

import numpy as np

from frictionid.arrays import Array


def with_base_motion(p: Array, motion: Array | None) -> Array:
    """Base parameters (..., nb) with the motion (..., 9) of a base behind them, (..., nb + 9).

    In the frame of the base: its angular velocity [rad/s], its angular acceleration [rad/s^2], and
    the proper acceleration of its origin [m/s^2], which is what an accelerometer shows: that less
    gravity. Position, orientation and velocity do not matter. Without it the base is at rest.
    """
    if motion is None:
        return p
    lead = np.broadcast_shapes(p.shape[:-1], motion.shape[:-1])
    parts = (np.broadcast_to(x, (*lead, x.shape[-1])) for x in (p, motion))
    return np.concatenate([*parts], axis=-1)


def base_motion_of(p: Array, count: int) -> Array | None:
    """Motion (..., 9) behind so many base parameters, or None."""
    return p[..., count:] if p.shape[-1] > count else None
