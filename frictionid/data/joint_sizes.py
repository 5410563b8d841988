"""Sizes of errors: what is much for a joint that turns, and for one that slides.

A metre is no radian, and much for one machine, little for another. Where joints of both kinds are
compared in one norm, each error counts in units of its joint's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset

# A prediction further off than this has diverged: [rad], and a share of the travel of a slide.
TURN, TRAVEL = 1.0, 0.25


def joint_sizes(position_units: Sequence[str], positions: Any) -> Array:
    """Sizes (n,) of the joints: 1 rad, or a quarter of the travel where a joint slides.

    positions (..., n) : measured ones, NaN where there are none

    >>> joint_sizes(("m", "rad"), np.array([[0.0, 0.2], [0.4, 9.0], [np.nan, np.nan]]))
    array([0.1, 1. ])
    """
    if set(position_units) == {"rad"}:
        return np.full(positions.shape[-1], TURN)
    flat = positions.reshape(-1, positions.shape[-1])
    travel = np.nanmax(flat, axis=0) - np.nanmin(flat, axis=0)
    revolute = np.array([unit == "rad" for unit in position_units])
    out: Array = np.where(revolute, TURN, TRAVEL * travel)
    return out


def joint_sizes_of(dataset: Dataset) -> Array:
    """Sizes (n,) of the joints of a data set by its measured positions, see `joint_sizes`."""
    positions = np.concatenate([r.angle.value for r in dataset.recordings])
    return joint_sizes(dataset.mechanism.position_units, positions)


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
    scaled = error / np.where(sizes > 0, sizes, 1.0)  # a joint that never moved counts as it is
    return np.linalg.norm(scaled, axis=-1), "1" + units[0].removeprefix("rad").removeprefix("m")
