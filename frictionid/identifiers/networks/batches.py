"""Which rows a network meets in which step, drawn for each fold by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array


def batches(counted: Array, size: int, seeds: Sequence[Sequence[int]]) -> Iterator[Array]:
    """Items (F, size) of each fold without end: all that count, shuffled, then all again.

    counted (F, C) says which of the C items count; the draws of a fold depend on nothing else but
    its seed.
    """
    queues = [
        _queue(np.flatnonzero(row), size, seed) for row, seed in zip(counted, seeds, strict=True)
    ]
    while True:
        yield np.stack([next(queue) for queue in queues])


def _queue(items: Array, size: int, seed: Sequence[int]) -> Iterator[Array]:
    rng = np.random.default_rng(seed)
    waiting = np.empty(0, dtype=int)
    while True:
        while len(waiting) < size:
            waiting = np.concatenate([waiting, rng.permutation(items)])
        yield waiting[:size]
        waiting = waiting[size:]


def side_by_side(counted: Array, empty: int) -> Array:
    """Items (F, most) of each fold that count, then `empty` up to the longest of them.

    >>> side_by_side(np.array([[True, False, True], [False, True, False]]), empty=-1)
    array([[ 0,  2],
           [ 1, -1]])
    """
    most = int(counted.sum(axis=1).max())
    out = np.full((len(counted), most), empty)
    for row, which in zip(out, counted, strict=True):
        items = np.flatnonzero(which)
        row[: len(items)] = items
    return out
