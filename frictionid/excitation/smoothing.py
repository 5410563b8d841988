"""The smoother as a linear map: from angles to smoothed angles and velocities."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array, lil_array

from frictionid.arrays import Array
from frictionid.data.kalman import even_series, likeliest_jerk_ratio, rts_smoother

_SUPPORT = 60  # samples; a smoothed state depends on those farther away by less than 1e-6
_DECADES = 4  # parts of a decade to which jerk ratios are rounded


def jerk_decades(q: Array, dt: float) -> Array:
    """Decades of the likeliest jerk ratio of noisy angles q (T, ...), (...), rounded to a quarter.

    One series for each entry of the other axes.
    """
    value = q.reshape(len(q), -1)
    decades = np.log10(likeliest_jerk_ratio(even_series(value, dt)))
    return (np.round(_DECADES * decades) / _DECADES).reshape(q.shape[1:])


def smoothed_states(q: Array, decades: Array, dt: float) -> tuple[Array, Array]:
    """Smoothed angles and velocities of angles q (T, ...), by decades of the jerk ratio (...)."""
    flat = q.reshape(len(q), -1)
    out = rts_smoother(even_series(flat, dt), 10.0 ** decades.ravel())
    return out[:, :, 0].reshape(q.shape), out[:, :, 1].reshape(q.shape)


@lru_cache(maxsize=96)
def smoother_gains(samples: int, dt: float, decade: float) -> tuple[csr_array, csr_array]:
    """Matrices (T, T) from angles to smoothed angles and velocities [1/s].

    >>> angle, velocity = smoother_gains(5, 0.1, 8.0)
    >>> line = np.arange(5) * 0.1
    >>> bool(np.allclose(angle @ line, line)), bool(np.allclose(velocity @ line, 1.0, atol=1e-3))
    (True, True)
    """
    size = min(samples, 2 * _SUPPORT + 1)
    response = rts_smoother(even_series(np.eye(size), dt), np.full(size, 10.0**decade))
    return _banded(response[:, :, 0], samples), _banded(response[:, :, 1], samples)


def _banded(response: Array, samples: int) -> csr_array:
    """The same response at the ends of a longer recording, its middle row between them."""
    size = len(response)
    half = size // 2
    out = lil_array((samples, samples))
    for i in range(samples):
        row = min(i, half) if i < samples - half else size - (samples - i)
        out[i, i - row : i - row + size] = response[row]
    return out.tocsr()
