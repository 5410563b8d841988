"""Scales of the joints: what is much and what is slow, for a joint that turns, and for a slide.

A metre is no radian, and much for one machine, little for another. A prediction that is further off
than the *size* of a joint has diverged, and errors of joints of both kinds count in units of it. A
joint below its *slow* speed is near rest. Both follow from the joint's own motion, so that nothing
depends on the unit of a position, on how long a slide is, or on how slow a machine.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import MAD, Array

from .signals import Signal

# Size: a quarter of the travel; of joints that turn, 1 rad at most.
TURN, TRAVEL = 1.0, 0.25
# Slow: 2 % of fast motion; of joints that turn, 0.1 rad/s at most.
SLOW_TURN, SLOW_SHARE = 0.1, 0.02
_CLEAR = 20.0  # times the noise of a position: what shows a motion
_NORMAL = MAD / np.sqrt(20.0)  # of noise over the median size of its third differences


class JointScales(NamedTuple):
    """Scales (n,) of the joints of a data set, in rad or m, and rad/s or m/s.

    size : further off than this is far ; fast : exceeded in 5 % of the time of some recording, zero
    of a joint that never moves by more than noise ; slow : a slower joint is near rest
    """

    size: Array
    fast: Array
    slow: Array


def joint_scales(position_units: Sequence[str], angles: Sequence[Signal]) -> JointScales:
    """Scales of joints from their measured positions.

    >>> time = np.linspace(0.0, 4.0, 401)
    >>> slide, turn = 2e-3 * np.sin(3.0 * time), 8.0 * np.sin(3.0 * time)
    >>> scales = joint_scales(("m", "rad"), [Signal(time, np.stack([slide, turn], axis=1))])
    >>> scales.size.round(6).tolist(), scales.fast.round(3).tolist()
    ([0.001, 1.0], [0.006, 23.906])
    >>> scales.slow.round(6).tolist()
    [0.00012, 0.1]
    """
    noise = np.max([_noise(a.value) for a in angles], axis=0)
    fast = np.max([_fast(a, noise) for a in angles], axis=0)
    size = joint_sizes(position_units, np.concatenate([a.value for a in angles]), _CLEAR * noise)
    revolute = np.array(position_units) == "rad"
    usual = SLOW_TURN * np.where(revolute, 1.0, size)
    slow = np.where(fast > 0, SLOW_SHARE * fast, usual)
    return JointScales(size, fast, np.where(revolute, np.minimum(slow, SLOW_TURN), slow))


def _noise(value: Array) -> Array:
    """Noise (n,) of positions (T, n), or what moves faster than their samples show."""
    if len(value) < 4:
        return np.zeros(value.shape[1])
    return _NORMAL * np.median(np.abs(np.diff(value, n=3, axis=0)), axis=0)


def _fast(angle: Signal, noise: Array) -> Array:
    """Speeds (n,) exceeded in 5 % of the time, over spans in which the motion is clear of noise."""
    value, time = np.asarray(angle.value, dtype=float), np.asarray(angle.time, dtype=float)
    out, span = np.zeros(value.shape[1]), 1
    while not out.all() and span < len(value):
        change = np.abs(value[span:] - value[:-span])
        speed = np.quantile(change / (time[span:] - time[:-span])[:, None], 0.95, axis=0)
        clear = np.quantile(change, 0.95, axis=0) > _CLEAR * noise
        out, span = np.where((out == 0) & clear, speed, out), 2 * span
    return out


def joint_sizes(position_units: Sequence[str], positions: Any, least: Array | float = 0.0) -> Array:
    """Sizes (n,) of the joints: a quarter of the travel, and of joints that turn 1 rad at most.

    positions (..., n) : measured ones, NaN where there are none ; least : (n,), more than noise

    >>> joint_sizes(("m", "rad"), np.array([[0.0, 0.2], [0.4, 9.0], [np.nan, np.nan]]))
    array([0.1, 1. ])
    >>> joint_sizes(("rad", "rad"), np.array([[0.0, 0.3], [0.4, 0.3]]))  # one never moves
    array([0.1, 1. ])
    """
    flat = positions.reshape(-1, positions.shape[-1])
    travel = np.nanmax(flat, axis=0) - np.nanmin(flat, axis=0)
    size = np.maximum(TRAVEL * travel, least)
    revolute = np.array(position_units) == "rad"
    return np.where(revolute & (size > 0), np.minimum(size, TURN), np.where(size > 0, size, 1.0))


def are_mixed(units: Sequence[str]) -> bool:
    """Whether joints have different units.

    >>> are_mixed(("m", "rad")), are_mixed(("m", "m"))
    (True, False)
    """
    return len(set(units)) > 1


def norm_of(error: Array, units: Sequence[str], sizes: Array) -> tuple[Array, str]:
    """Norm (...) over the joints of errors (..., n), and its unit.

    Errors of joints of different units count in units of the sizes (n,): the norm's unit then is
    "1", or "1/s" of velocities.

    >>> norm_of(np.array([[3.0, 4.0]]), ("rad", "rad"), np.ones(2))
    (array([5.]), 'rad')
    >>> norm_of(np.array([[0.3, 4.0]]), ("m/s", "rad/s"), np.array([0.1, 1.0]))
    (array([5.]), '1/s')
    """
    if not are_mixed(units):
        return np.linalg.norm(error, axis=-1), units[0]
    return np.linalg.norm(error / sizes, axis=-1), "1" + units[0].removeprefix("rad").removeprefix(
        "m"
    )
