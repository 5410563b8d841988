"""Joints declared equal: whether a fit that gives each joint its own parameters says so, too."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.special import stdtr  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.config import nearest
from frictionid.errors import InputError
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifier import Identifier
from frictionid.friction import Friction, Groups

LEVEL = 0.01  # p-values below it say that joints are not equal


class Difference(NamedTuple):
    """A parameter of two joints, from 1, that were declared equal, as each joint has it by itself.

    p_value : of Wald's test, times the number of such tests
    """

    parameter: str
    joints: tuple[int, int]
    values: tuple[float, float]
    unit: str
    p_value: float


def equal_groups(identifier: Identifier) -> Groups:
    """Groups of joints that an identifier, or the one within it, holds equal."""
    groups: Groups = getattr(identifier, "equal", ())
    return groups or next((equal_groups(part) for part in _parts(identifier).values()), ())


def with_equal(identifier: Identifier, equal: Groups) -> Identifier:
    """The identifier that holds these joints equal; () gives each its own parameters.

    Raises
    ------
    InputError
        For identifiers that hold none equal, such as networks.

    >>> from frictionid.friction.laws import CoulombViscous
    >>> from frictionid.fitting.identifiers import LeastSquares
    >>> with_equal(LeastSquares(CoulombViscous()), ((1, 2),)).equal
    ((1, 2),)
    """
    if hasattr(identifier, "equal"):
        changed: Any = identifier
        return cast(Identifier, replace(changed, equal=equal))
    for name, part in _parts(identifier).items():
        return cast(Identifier, replace(cast(Any, identifier), **{name: with_equal(part, equal)}))
    raise InputError(
        f"{type(identifier).__name__} holds no joints equal: laws with parameters do, such as "
        "stribeck"
    )


def _parts(identifier: Any) -> dict[str, Identifier]:
    """Identifiers within an identifier, by its fields."""
    names = [f.name for f in fields(identifier)] if is_dataclass(identifier) else []
    return {n: p for n in names if isinstance(p := getattr(identifier, n), Identifier)}


def groups_of(equal: Sequence[Sequence[str | int]], joints: Sequence[str]) -> Groups:
    """Groups of joints by their numbers from 1, of names or numbers.

    >>> groups_of([["hip", "knee"], [3, 4]], ["hip", "knee", "left", "right"])
    ((1, 2), (3, 4))
    """

    def number(joint: str | int) -> int:
        if isinstance(joint, int) or str(joint).isdecimal():
            return int(joint)
        if joint not in joints:
            raise InputError(f"equal: there is no joint {joint!r}; {nearest(joint, joints)}")
        return 1 + list(joints).index(joint)

    if not isinstance(equal, Sequence) or not all(isinstance(g, list | tuple) for g in equal):
        raise InputError(f"equal = {equal!r} must be groups of joints, such as [[1, 2]]")
    return tuple(tuple(number(joint) for joint in group) for group in equal)


def differences(fit: Fit, equal: Groups) -> list[Difference]:
    """Wald's tests of a fit that gives joints their own parameters, for groups of equal ones.

    Each parameter of a joint against that of the first of its group, where both are known, with
    the t distribution of the fit's intervals. P-values are multiplied by their number (Bonferroni).
    """
    friction, (covariance, freedom) = fit.friction, _covariance(fit)
    theta = np.asarray(friction.theta, dtype=float)
    P = theta.shape[-1]
    out = []
    for first, *others in equal:
        for other in others:
            for i, name in enumerate(friction.law.names):
                at = [(j - 1) * P + i for j in (first, other)]
                contrast = covariance[np.ix_(at, at)]
                error = np.sqrt(contrast[0, 0] + contrast[1, 1] - 2 * contrast[0, 1])
                if not (np.isfinite(error) and error > 0):
                    continue
                values = float(theta[first - 1, i]), float(theta[other - 1, i])
                p = 2.0 * float(stdtr(freedom, -abs(values[0] - values[1]) / error))
                unit = friction.units_at(first - 1)[i]
                out.append(Difference(name, (first, other), values, unit, p))
    return [d._replace(p_value=min(1.0, d.p_value * len(out))) for d in out]


def sentences(tests: list[Difference], equal: Groups) -> list[str]:
    """What the tests say of each group."""
    out = []
    for group in equal:
        tested = [d for d in tests if d.joints[0] == group[0]]
        unlike = [d for d in tested if d.p_value < LEVEL]
        out += [
            f"joints {d.joints[0]} and {d.joints[1]} are not equal: fitted apart, {d.parameter} is "
            f"{d.values[0]:.4g} and {d.values[1]:.4g} {d.unit} (p = {d.p_value:.2g})"
            for d in unlike
        ]
        named = " and ".join(map(str, group))
        if not tested:
            out.append(f"joints {named}: fitted apart, no parameter is known of both to compare")
        elif not unlike:
            least = min(d.p_value for d in tested)
            out.append(f"joints {named}: fitted apart, they do not differ (p = {least:.2g})")
    return out


def _covariance(fit: Fit) -> tuple[Array, int]:
    """Covariance (n P, n P) of the friction of all data, NaN where unknown, and its freedom."""
    covariance, shape = fit.covariance, np.shape(fit.friction.theta)
    places = [
        (k, int(np.ravel_multi_index(p.place, shape)))
        for k, p in enumerate(covariance.parameters)
        if p.block == "friction" and np.isfinite(covariance.error[k])
    ]
    out = np.full(2 * [int(np.prod(shape))], np.nan)
    at, to = (np.array([pair[i] for pair in places], dtype=int) for i in (0, 1))
    out[np.ix_(to, to)] = covariance.matrix[np.ix_(at, at)]
    return out, covariance.freedom


def check_units(friction: Friction, equal: Groups) -> None:
    """Refuse joints that turn beside joints that slide."""
    for group in equal:
        if len({friction.units_at(j - 1) for j in group}) > 1:
            named = " and ".join(map(str, group))
            raise InputError(f"joints {named} turn and slide: their friction cannot be equal")
