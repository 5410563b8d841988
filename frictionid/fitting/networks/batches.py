"""Batches of a training set, drawn for each fold by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array


def batches(used: Array, size: int, seeds: Sequence[Sequence[int]]) -> Iterator[Array]:
    """Items (F, size) of each fold without end: all used ones shuffled, then all again.

    used (F, C) says which of the C items a fold uses; its draws depend on nothing else but its
    seed.
    """
    queues = [
        _queue(np.flatnonzero(items), size, seed) for items, seed in zip(used, seeds, strict=True)
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


def padded_items(used: Array, padding: int) -> Array:
    """Items (F, most) that each fold uses, then `padding` up to the longest of them.

    >>> padded_items(np.array([[True, False, True], [False, True, False]]), padding=-1)
    array([[ 0,  2],
           [ 1, -1]])
    """
    most = int(used.sum(axis=1).max())
    rows = [np.flatnonzero(items) for items in used]
    return np.stack([np.pad(r, (0, most - len(r)), constant_values=padding) for r in rows])
