"""Bounds and priors of parameters: those of a law, what the data resolve, and given ones.

What the data do not tell must not matter: a law says for its parameters what they are like then, a
neutral value and a size. Both are in multiples of what is usual in the data, by the unit:

    N m               the level of friction: what it is on average, whatever the law
    N m s/rad         level / speed, with the fastest speed; N m s^2/rad^2: level / speed^2
    N m/N             level / load, with the mean load; at least 3 % of that of any other joint
    1/(N m)           level / torque^2, with the motor torque's root mean square

Parameters of other units, times and shares, have their neutral value and size as they are. The
velocity of a peak has neither: without the peak it means nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError

from .law import Law, LawParameter

Groups = tuple[tuple[int, ...], ...]  # of joints, from 1
_FREE = (0.0, float("inf"))
_BEYOND = 3.0  # times the fastest speed: effects that set in later look like another level
PEAK_SHOWN = 0.5  # times the slowest speed: of a narrower peak less than exp(-4) = 2 % shows


class DataRange(NamedTuple):
    """What data show of each joint, (..., n): speeds that they resolve, and what is usual.

    slowest, fastest : [rad/s]; level : [N m], mean friction torque; load : [N], mean bearing load;
    torque : [N m], root mean square of the motor torque. Without the last three no parameter that
    scales with them has a neutral value.
    """

    slowest: Array
    fastest: Array
    level: Array | None = None
    load: Array | None = None
    torque: Array | None = None

    def usual(self, unit: str) -> Array | float:
        """What is usual for a parameter of a unit; infinite where the data do not show it."""
        level, speed = _or_endless(self.level), self.fastest
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            by_unit = {
                "N m": level,
                "N m s/rad": level / speed,
                "N m s^2/rad^2": level / speed**2,
                "N m/N": level / _or_endless(self.load),
                "1/(N m)": level / _or_endless(self.torque) ** 2,
            }
        return by_unit.get(unit, 1.0)


def _or_endless(value: Array | None) -> Array:
    """The value, or infinity where it is not known."""
    return np.array(np.inf) if value is None else np.asarray(value)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Bounds and normal priors of parameters theta, arrays of its shape (..., n, P).

    low, high : bounds; mean, deviation : of the prior, the deviation infinite where there is none
    neutral, size : what they are where data do not tell them, and how far from that they usually
        are; a size of infinity where the law has no neutral value
    equal : groups of joints, from 1, that have the same parameters
    """

    low: Array
    high: Array
    mean: Array
    deviation: Array
    neutral: Array
    size: Array
    equal: Groups = ()

    def at(self, index: Any) -> "Constraints":
        """Constraints at an index into the batch axes."""
        arrays = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "equal"}
        return replace(self, **arrays)

    @property
    def owner(self) -> Array:
        """Joint (n,), from 0, whose parameters each joint has: the first of its group, or itself.

        >>> ones = np.ones((3, 2))
        >>> Constraints(0 * ones, ones, ones, ones, ones, ones, ((1, 3),)).owner
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


def present(law: Law, theta: Array) -> Array:
    """Which parameters (..., n, P) friction has, without optional terms that are zero.

    >>> from frictionid.friction.laws import Cogging
    >>> present(Cogging((6, 12)), np.array([[0.1, -0.2, 0.0, 0.0]]))
    array([[ True,  True, False, False]])
    """
    theta, optional = np.asarray(theta), [law.is_sparse or p.optional for p in law.parameters]
    has = law.has_parameters(theta.shape[-2])
    return has & ((theta != 0) | ~np.array(optional, dtype=bool)) if any(optional) else has


def constraints_of(
    law: Law,
    speeds: DataRange,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    equal: Groups = (),
) -> Constraints:
    """Constraints (..., n, P) of a law's parameters on joints with a range of speeds (..., n).

    Neutral values are those of the law, see the top of this file. A law's velocity that it bounds
    by (0, inf) lies between the slowest speed that the data show and resolve and three times the
    fastest one: slower effects pass between two samples, or are over before motion begins.

    bounds : given bounds by parameter name, in place of these
    prior : mean and standard deviation by parameter name, in place of the neutral value
    equal : groups of joints that have the same parameters

    Raises
    ------
    InputError
        For names that the law does not have, bounds without room or wider than the law's,
        deviations that are not positive, and groups of joints that cannot be equal.

    >>> from frictionid.friction.laws import Stribeck
    >>> speeds = DataRange(np.array([0.2]), np.array([9.0]))
    >>> own = constraints_of(Stribeck(), speeds, {"viscous": (0.0, 1.0)})
    >>> own.low, own.high
    (array([[0. , 0. , 0.2, 0. ]]), array([[inf, inf, 27.,  1.]]))
    """
    bounds, prior = bounds or {}, prior or {}
    for name in (*bounds, *prior):
        if name not in law.names:
            raise InputError(f"{law} has no parameter {name!r}; {nearest(name, law.names)}")
    shape = (*speeds.slowest.shape, len(law.names))
    low, high, mean, deviation, neutral, size = (np.zeros(shape) for _ in range(6))
    for i, parameter in enumerate(law.parameters):
        name, unit, limits = parameter.name, parameter.unit, (parameter.low, parameter.high)
        low[..., i], high[..., i] = _checked(name, bounds.get(name, limits), limits)
        if unit == "rad/s" and tuple(limits) == _FREE and name not in bounds:
            low[..., i] = speeds.slowest
            high[..., i] = _BEYOND * np.maximum(speeds.fastest, speeds.slowest)
        mean[..., i], deviation[..., i] = _prior(name, prior.get(name))
        neutral[..., i], size[..., i] = _neutral(parameter, speeds)
        if name in prior:
            size[..., i] = np.inf
    neutral = np.clip(neutral, low, high)
    absent = ~law.has_parameters(shape[-2])
    low[..., absent], high[..., absent] = 0.0, 0.0
    deviation[..., absent], size[..., absent] = np.inf, np.inf
    groups = _checked_groups(law, equal, shape[-2])
    for group in groups:
        joints = np.array(group) - 1
        low[..., joints, :] = low[..., joints, :].max(axis=-2, keepdims=True)
        high[..., joints, :] = high[..., joints, :].min(axis=-2, keepdims=True)
        neutral[..., joints, :] = neutral[..., joints, :].mean(axis=-2, keepdims=True)
        size[..., joints, :] = size[..., joints, :].max(axis=-2, keepdims=True)
    return Constraints(low, high, mean, deviation, neutral, size, groups)


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


def _neutral(parameter: LawParameter, data: DataRange) -> tuple[Array | float, Array | float]:
    """Neutral value and size (..., n) of a parameter in some data."""
    if not np.isfinite(parameter.size):
        return 0.0, np.inf
    usual = np.asarray(data.usual(parameter.unit), dtype=float)
    shown = np.isfinite(usual) & (usual > 0)
    usual = np.where(shown, usual, 1.0)
    neutral = np.where(shown, parameter.neutral * usual, 0.0)
    return neutral, np.where(shown, parameter.size * usual, np.inf)


def _prior(name: str, entry: tuple[float, float] | None) -> tuple[float, float]:
    mean, deviation = (0.0, float("inf")) if entry is None else entry
    if not (np.isfinite(mean) and deviation > 0):
        raise InputError(
            f"prior of {name!r} = [{mean:g}, {deviation:g}] must be a mean and a positive standard "
            "deviation"
        )
    return mean, deviation
