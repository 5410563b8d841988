"""Rows of a table of scores, and the statistics that summarise errors into them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array

# A prediction further off than this, or not finite, has diverged: [rad], and for joints that slide
# a share of their travel, for a metre is much for one machine and little for another.
DIVERGED, TRAVEL = 1.0, 0.25


class Row(NamedTuple):
    """One score of one friction: fold is "0", "1", ... or "all", joint "1", "2", ... or "all"."""

    fold: str
    score: str
    statistic: str
    horizon_s: float | None
    joint: str
    value: float
    unit: str


def summarise(
    errors: Array, fold: str, score: str, joint: str, unit: str, horizon: float | None = None
) -> Iterator[Row]:
    """Rows of mean, rms, median and 90 % quantile of absolute errors (N,), all finite."""
    statistics = {
        "mean": np.mean(errors),
        "rms": np.sqrt(np.mean(errors**2)),
        "median": np.median(errors),
        "q90": np.quantile(errors, 0.9),
    }
    for name, value in statistics.items():
        yield Row(fold, score, name, horizon, joint, float(value), unit)


def far(angle_unit: str, positions: Array) -> Array:
    """Errors (n,) beyond which a prediction has diverged: 1 rad, or a quarter of a joint's travel.

    positions (..., n) : measured ones, NaN where there are none

    >>> far("m", np.array([[0.0], [0.4], [np.nan]]))
    array([0.1])
    """
    if angle_unit == "rad":
        return np.full(positions.shape[-1], DIVERGED)
    flat = positions.reshape(-1, positions.shape[-1])
    out: Array = TRAVEL * (np.nanmax(flat, axis=0) - np.nanmin(flat, axis=0))
    return out


def summarise_rollouts(
    errors: Array, fold: str, score: str, joint: str, horizon: float, beyond: float = DIVERGED
) -> Iterator[Row]:
    """Rows of median, 90 % quantile and diverged share of rollout errors (N,) [rad].

    Diverged predictions stay in the quantiles, at infinity when they are not finite; those
    `beyond` off count as such.

    >>> [r.value for r in summarise_rollouts(np.array([0.1, 0.2, np.nan]), "0", "x", "all", 1.0)]
    [0.2, inf, 0.3333333333333333]
    """
    errors = np.where(np.isfinite(errors), errors, np.inf)
    for name, level in (("median", 0.5), ("q90", 0.9)):
        yield Row(fold, score, name, horizon, joint, _quantile(errors, level), "rad")
    yield Row(fold, score, "diverged", horizon, joint, float(np.mean(errors > beyond)), "1")


def _quantile(values: Array, level: float) -> float:
    """Quantile between the two nearest of the values, some of them infinite (NumPy's turns NaN)."""
    ordered = np.sort(values)
    at = round(level * (len(ordered) - 1), 9)
    low, part = int(at), at - int(at)
    if part == 0.0:
        return float(ordered[low])
    return float((1.0 - part) * ordered[low] + part * ordered[low + 1])
