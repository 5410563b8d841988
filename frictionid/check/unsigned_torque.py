"""Torques or currents that were logged without their sign.

The size of a signal that changes its sign has a kink wherever it does: near zero it falls and rises
again, and with the sign turned there it would go on as before. A torque that only ever acts in one
direction has no such kinks, whatever its noise.
"""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.data.recordings import Dataset

# Kinks at least; second differences around one are so many times those with the sign turned, and no
# reading is zero so many samples before or behind: what is cut off at zero is no size.
KINKS, STRAIGHTER, CLEAR = 3, 3.0, 4


def unsigned_torques(dataset: Dataset) -> list[Finding]:
    """A finding for each driven joint whose torque has lost its sign."""
    out = []
    for j in np.flatnonzero(dataset.mechanism.driven).tolist():
        columns = [np.asarray(r.torque.value)[:, j] for r in dataset.recordings]
        values = np.concatenate(columns)
        if not values.any() or values.min() < 0.0 < values.max():
            continue
        found = sum(len(kinks(np.abs(column))) for column in columns)
        if found >= KINKS:
            out.append(_finding(j, found))
    return out


def kinks(size: Array) -> Array:
    """Samples behind which a signal (T,) of one sign seems to have changed its sign.

    >>> time = np.arange(40) / 10.0
    >>> [kinks(np.abs(np.cos(2 * time))).tolist(), kinks(1.0 + np.cos(2 * time)).tolist()]
    [[7, 23], []]
    """
    first, before, a, b, behind, last = (size[k : len(size) - 5 + k] for k in range(6))
    bent = np.abs(before - 2 * a + b) + np.abs(a - 2 * b + behind)
    turned = np.abs(before - 2 * a - b) + np.abs(a + 2 * b - behind)
    falls = (first > before) & (before > a) & (b < behind) & (behind < last)
    places = np.flatnonzero(falls & (bent > STRAIGHTER * turned)) + 2
    zeros = np.append(0, np.cumsum(size == 0.0))
    stop = np.minimum(places + CLEAR + 2, len(size))
    return places[zeros[stop] == zeros[np.maximum(places - CLEAR, 0)]]


def _finding(j: int, found: int) -> Finding:
    return Finding(
        "unsigned_torque",
        "unusable",
        f"torque {j + 1} never changes its sign, and has a kink at zero {found} times where it "
        "would: its sign was not logged",
        "log the signed torque or current; nothing in the data gives the sign back",
        j + 1,
        {"kinks": float(found)},
    )
