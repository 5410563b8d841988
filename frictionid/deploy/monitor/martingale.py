"""Evidence of a change while recordings arrive one by one: a conformal test martingale.

Each recording is ranked among all so far by its distance from their mean; its p-value is uniform
and independent of the earlier ones, as long as recordings are exchangeable. A bet against that,

    E_t = product over i of the integral of e p_i^(e - 1) de from 0 to 1

is a martingale that begins at one: with probability at least 1 - rate it never reaches 1/rate
[Vovk2005], [Ville1939]. So the rate holds for the whole time of monitoring, however long.
"""

from __future__ import annotations

import zlib

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.monitor.two_samples import white_rows


def log_evidence(healthy: Array, arrived: Array, names: tuple[str, ...]) -> Array:
    """Logarithm of the evidence (k,) after each of k recordings that arrived.

    Parameters
    ----------
    healthy : array, shape (N, n, d)
    arrived : array, shape (k, n, d), in the order of arrival
    names : of the recordings that arrived; equal ranks are broken by them, at random

    >>> rng = np.random.default_rng(1)
    >>> sick = rng.normal(size=(8, 1, 2)) + 8.0
    >>> after = log_evidence(rng.normal(size=(60, 1, 2)), sick, tuple("abcdefgh"))
    >>> bool(after[-1] > np.log(100))
    True
    """
    rows = np.concatenate([healthy, arrived])
    first = len(healthy) + 1
    return np.cumsum([log_bet(rows[: first + i], name) for i, name in enumerate(names)])


def log_bet(rows: Array, name: str) -> float:
    """Logarithm of the bet on the last of recordings (N, n, d); `name` breaks equal ranks."""
    distance = (white_rows(rows) ** 2).sum(axis=-1).max(axis=-1)
    further, equal = (distance > distance[-1]).sum(), (distance == distance[-1]).sum()
    share = np.random.default_rng(zlib.crc32(name.encode())).random()
    return _log_bet(float((further + share * equal) / len(rows)))


def _log_bet(p: float) -> float:
    """Logarithm of the integral of e p^(e - 1) de over e from 0 to 1.

    >>> round(float(np.exp(_log_bet(1.0))), 6), round(float(np.exp(_log_bet(0.01))), 2)
    (0.5, 4.45)
    """
    p = min(max(p, 1e-12), 1.0)
    a = np.log(p)
    if abs(a) < 1e-4:
        return float(np.log(0.5 - a / 6.0))
    return float(np.log((1.0 - p + p * a) / (p * a * a)))
