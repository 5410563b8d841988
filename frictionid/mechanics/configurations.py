"""Joint positions that stand for all of a mechanism, where something must hold in each."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array

_MOST = 2  # joints of which a grid is made
_COUNT = 512


def configurations(n: int, steps: int) -> Array:
    """Positions (C, n) of n joints in -pi to pi [rad or m].

    Of up to two joints a grid of so many steps each; of more, where grids grow beyond all bounds,
    512 that fill the space evenly, with the first at zero [Roberts2018].

    >>> configurations(1, 3).ravel().round(2)
    array([-3.14,  0.  ,  3.14])
    >>> configurations(7, 3).shape
    (512, 7)
    """
    if n <= _MOST:
        grid = np.meshgrid(*[np.linspace(-np.pi, np.pi, steps)] * n, indexing="ij")
        return np.stack(grid, axis=-1).reshape(-1, n)
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (n + 1))  # the root of x^(n + 1) = x + 1
    share = (0.5 + np.arange(_COUNT)[:, None] * ratio ** -np.arange(1.0, n + 1)) % 1.0
    return np.pi * (2.0 * share - 1.0)
