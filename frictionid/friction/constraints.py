"""Bounds and priors of parameters: those of a law, what the data resolve, and given ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.friction.law import Law

_FREE = (0.0, float("inf"))
_BEYOND = 3.0  # times the fastest speed: effects that set in later look like another level


class SpeedRange(NamedTuple):
    """Slowest and fastest speed (..., n) [rad/s] of each joint that data resolve."""

    slowest: Array
    fastest: Array


@dataclass(frozen=True, eq=False)
class Constraints:
    """Bounds and normal priors of parameters theta, arrays of its shape (..., n, P).

    low, high : bounds; mean, deviation : of the prior, the deviation infinite where there is none
    """

    low: Array
    high: Array
    mean: Array
    deviation: Array

    def at(self, index: Any) -> Constraints:
        """Those at an index into the batch axes."""
        arrays = (self.low, self.high, self.mean, self.deviation)
        return Constraints(*(array[index] for array in arrays))


def constraints_of(
    law: Law,
    speeds: SpeedRange,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
) -> Constraints:
    """Constraints (..., n, P) of a law's parameters on joints with a range of speeds (..., n).

    A law's velocity that it bounds by (0, inf) lies between the slowest speed that the data resolve
    and three times the fastest one: slower effects pass between two samples.

    bounds : given bounds by parameter name, in place of these
    prior : mean and standard deviation by parameter name

    Raises
    ------
    InputError
        For names that the law does not have, bounds without room or wider than the law's, and
        deviations that are not positive.

    >>> from frictionid.friction.laws import Stribeck
    >>> speeds = SpeedRange(np.array([0.2]), np.array([9.0]))
    >>> own = constraints_of(Stribeck(), speeds, {"viscous": (0.0, 1.0)})
    >>> own.low, own.high
    (array([[0. , 0. , 0.2, 0. ]]), array([[inf, inf, 27.,  1.]]))
    """
    bounds, prior = bounds or {}, prior or {}
    for name in (*bounds, *prior):
        if name not in law.names:
            raise InputError(f"{law} has no parameter {name!r}; {nearest(name, law.names)}")
    shape = (*speeds.slowest.shape, len(law.names))
    low, high, mean, deviation = (np.zeros(shape) for _ in range(4))
    for i, (name, unit, own) in enumerate(zip(law.names, law.units, law.bounds, strict=True)):
        low[..., i], high[..., i] = _checked(name, bounds.get(name, own), own)
        if unit == "rad/s" and tuple(own) == _FREE and name not in bounds:
            low[..., i] = speeds.slowest
            high[..., i] = _BEYOND * np.maximum(speeds.fastest, speeds.slowest)
        mean[..., i], deviation[..., i] = _prior(name, prior.get(name))
    absent = ~law.has_parameters(shape[-2])
    low[..., absent], high[..., absent], deviation[..., absent] = 0.0, 0.0, np.inf
    return Constraints(low, high, mean, deviation)


def _checked(
    name: str, given: tuple[float, float], own: tuple[float, float]
) -> tuple[float, float]:
    low, high = given
    if not own[0] <= low < high <= own[1]:
        raise InputError(
            f"bounds of {name!r} = [{low:g}, {high:g}] must increase, within the law's own "
            f"[{own[0]:g}, {own[1]:g}]"
        )
    return low, high


def _prior(name: str, given: tuple[float, float] | None) -> tuple[float, float]:
    mean, deviation = (0.0, float("inf")) if given is None else given
    if not (np.isfinite(mean) and deviation > 0):
        raise InputError(
            f"prior of {name!r} = [{mean:g}, {deviation:g}] must be a mean and a positive standard "
            "deviation"
        )
    return mean, deviation
