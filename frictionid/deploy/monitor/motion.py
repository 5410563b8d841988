"""How recordings move, and whether new ones move as healthy ones did."""

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array, rms

MEASURES = "faster", "more abrupt"
MARGIN = np.log(1.25)  # beyond the healthy recordings, or half of their range if that is more


def motion_of(time: Array, w: Array, floor: Array) -> Array:
    """Logarithms (n, 2) of the speed that 5 % of the time exceeds, and of the RMS acceleration.

    Parameters
    ----------
    time, w : arrays, shapes (K,), (K, n)
    floor : array, shape (n,)
        Speed below which a joint counts as still.
    """
    both = np.stack([floor, floor])
    if len(time) >= 3:
        steps = np.diff(time)
        usual = steps <= 3.0 * np.median(steps)
        a = np.diff(w, axis=0)[usual] / steps[usual, None]
        speed, abruptness = np.quantile(np.abs(w), 0.95, axis=0), rms(a, 0)
        both = np.maximum([speed, abruptness], both)
    return np.log(both.T)


def beyond(healthy: Array, new: Array) -> Array:
    """Whether (k, n, 2) new motion is faster or more abrupt than healthy motion (N, n, 2) ever was.

    >>> beyond(np.zeros((3, 1, 2)), np.array([[[0.1, 1.0]], [[-1.0, 0.0]]])).tolist()
    [[[False, True]], [[False, False]]]
    """
    low, high = healthy.min(axis=0), healthy.max(axis=0)
    return new > high + np.maximum(MARGIN, 0.5 * (high - low))


def apart(healthy: Array, new: Array) -> Array:
    """Whether (k,) new motion (k, n, 2) leaves the range of healthy motion (N, n, 2), from 0 to 1.

    One where a measure lies a range of the healthy recordings outside, or a quarter of the speed
    where they are alike. Slower motion asks for no friction that they did not show: one is enough.

    >>> apart(np.zeros((3, 1, 2)), np.array([[[-0.11157, 0.0]], [[-9.0, 0.0]]])).round(2)
    array([0.5, 1. ])
    """
    low, high = healthy.min(axis=0), healthy.max(axis=0)
    off = np.maximum(new - high, 0.0) + np.maximum(low - new, 0.0)
    return np.minimum(off / np.maximum(MARGIN, high - low), 1.0).max(axis=(1, 2))


def sentence(side: Array, joints: Sequence[str]) -> str:
    """What exceeds, of an array (n, 2) like a row of `beyond`.

    >>> sentence(np.array([[True, True], [False, True]]), ("joint 1", "joint 2"))
    'faster (joint 1), more abrupt (joint 2)'
    """
    rows = zip(side, joints, strict=True)
    return ", ".join(
        f"{MEASURES[int(np.argmax(row))]} ({joint})" for row, joint in rows if row.any()
    )
