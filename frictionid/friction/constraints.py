"""Bounds and priors of parameters: those of a law, what the data resolve, and given ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.friction.law import Law

Groups = tuple[tuple[int, ...], ...]  # of joints, from 1
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
    equal : groups of joints, from 1, that have the same parameters
    """

    low: Array
    high: Array
    mean: Array
    deviation: Array
    equal: Groups = ()

    def at(self, index: Any) -> Constraints:
        """Those at an index into the batch axes."""
        low, high, mean, deviation = (
            array[index] for array in (self.low, self.high, self.mean, self.deviation)
        )
        return Constraints(low, high, mean, deviation, self.equal)

    @property
    def owner(self) -> Array:
        """Joint (n,), from 0, whose parameters each joint has: the first of its group, or itself.

        >>> ones = np.ones((3, 2))
        >>> Constraints(0 * ones, ones, ones, ones, ((1, 3),)).owner
        array([0, 1, 0])
        """
        out = np.arange(self.low.shape[-2])
        for group in self.equal:
            out[np.array(group) - 1] = min(group) - 1
        return out

    @property
    def tie(self) -> Array | None:
        """Matrix (n P, D) that gives flat parameters of those D that differ; None where all do."""
        if not self.equal:
            return None
        _, rank = np.unique(self.owner, return_inverse=True)
        return np.kron(np.eye(int(rank.max()) + 1)[rank], np.eye(self.low.shape[-1]))


def constraints_of(
    law: Law,
    speeds: SpeedRange,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    equal: Groups = (),
) -> Constraints:
    """Constraints (..., n, P) of a law's parameters on joints with a range of speeds (..., n).

    A law's velocity that it bounds by (0, inf) lies between the slowest speed that the data resolve
    and three times the fastest one: slower effects pass between two samples.

    bounds : given bounds by parameter name, in place of these
    prior : mean and standard deviation by parameter name
    equal : groups of joints that have the same parameters

    Raises
    ------
    InputError
        For names that the law does not have, bounds without room or wider than the law's,
        deviations that are not positive, and groups of joints that cannot be equal.

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
    for i, (name, unit, limits) in enumerate(zip(law.names, law.units, law.bounds, strict=True)):
        low[..., i], high[..., i] = _checked(name, bounds.get(name, limits), limits)
        if unit == "rad/s" and tuple(limits) == _FREE and name not in bounds:
            low[..., i] = speeds.slowest
            high[..., i] = _BEYOND * np.maximum(speeds.fastest, speeds.slowest)
        mean[..., i], deviation[..., i] = _prior(name, prior.get(name))
    absent = ~law.has_parameters(shape[-2])
    low[..., absent], high[..., absent], deviation[..., absent] = 0.0, 0.0, np.inf
    for group in _checked_groups(law, equal, shape[-2]):
        joints = np.array(group) - 1
        low[..., joints, :] = low[..., joints, :].max(axis=-2, keepdims=True)
        high[..., joints, :] = high[..., joints, :].min(axis=-2, keepdims=True)
    return Constraints(low, high, mean, deviation, tuple(map(tuple, equal)))


def _checked_groups(law: Law, equal: Sequence[Sequence[int]], joints: int) -> Groups:
    """Groups of equal joints, each joint in one of them."""
    has = law.has_parameters(joints)
    seen: set[int] = set()
    for group in equal:
        where = f"equal = {[list(g) for g in equal]}"
        if len(group) < 2 or not all(1 <= j <= joints for j in group):
            raise InputError(
                f"{where}: each group names two joints or more by their numbers, 1 to {joints}"
            )
        if len({*group}) < len(group) or seen & {*group}:
            raise InputError(f"{where}: names a joint twice: give each joint once")
        seen |= {*group}
        if not (has[np.array(group) - 1] == has[group[0] - 1]).all():
            raise InputError(f"{where}: these joints have different laws: give them the same")
    return tuple(tuple(group) for group in equal)


def _checked(
    name: str, entry: tuple[float, float], limits: tuple[float, float]
) -> tuple[float, float]:
    low, high = entry
    if not limits[0] <= low < high <= limits[1]:
        raise InputError(
            f"bounds of {name!r} = [{low:g}, {high:g}] must increase, within the law's own "
            f"[{limits[0]:g}, {limits[1]:g}]"
        )
    return low, high


def _prior(name: str, entry: tuple[float, float] | None) -> tuple[float, float]:
    mean, deviation = (0.0, float("inf")) if entry is None else entry
    if not (np.isfinite(mean) and deviation > 0):
        raise InputError(
            f"prior of {name!r} = [{mean:g}, {deviation:g}] must be a mean and a positive standard "
            "deviation"
        )
    return mean, deviation
