"""Members of an observer: the fit's parameters, and one for each direction of its covariance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.fitting.fit import estimates_of
from frictionid.friction import Friction
from frictionid.friction.provenance import Estimate
from frictionid.mechanics import Mechanism

from ..pooling.models import place_of
from .momentum_observer import Members

_SENSORS = ("gain", "bias", "offset", "delay")


def members_of(friction: Friction, mechanism: Mechanism, base: Array) -> Members:
    """The fit's parameters first, then those a standard deviation off, in independent directions.

    Directions are of the covariance of a fit by shooting or inverse dynamics, of the intervals of
    one in one step, and of the masses' tolerances where the fit held these.

    Parameters
    ----------
    friction : Friction, theta (n, P)
    mechanism : Mechanism
    base : array, shape (nb,)
        Base parameters of the machine, by the fit's calibration.
    """
    calibration = friction.calibration or Calibration.ideal(mechanism.n)
    middle = Members(
        np.asarray(friction.theta, dtype=float),
        base,
        np.asarray(calibration.gain, dtype=float),
        np.asarray(calibration.bias, dtype=float),
        np.asarray(calibration.offset, dtype=float),
        np.asarray(calibration.delay, dtype=float),
    )
    every = [middle, *_off(middle, friction, mechanism)]
    members = Members(*(np.stack(column) for column in zip(*every, strict=True)))
    low, high = np.array(friction.law.bounds, dtype=float).reshape(-1, 2).T
    return members._replace(theta=np.clip(members.theta, low, high))


def _off(middle: Members, friction: Friction, mechanism: Mechanism) -> Iterator[Members]:
    """Members that are off by a standard deviation in each direction."""
    estimates, root = _directions(friction)
    for row in root.T:
        off = Members(*(np.array(values, dtype=float) for values in middle))
        for estimate, size in zip(estimates, row, strict=True):
            _add(off, estimate, size, friction, mechanism)
        yield off
    if not any(e.block == "inertia" for e in estimates):
        tolerances = mechanism.base_tolerances()
        for i in np.flatnonzero(np.isfinite(tolerances)):
            heavier = middle.base.copy()
            heavier[i] += tolerances[i]
            yield middle._replace(base=heavier)


def _directions(friction: Friction) -> tuple[Sequence[Estimate], Array]:
    """Estimates that have an error, and a root (D, k) of their covariance."""
    estimates, refined = estimates_of(friction), friction.provenance.refined
    covariance = np.diag([e.error**2 for e in estimates]).reshape(2 * [len(estimates)])
    if refined is not None and len(refined.parameters) == len(estimates):
        covariance = refined.square(refined.covariance)
    finite = np.isfinite(covariance).all(axis=1) & (np.diag(covariance) > 0)
    value, vector = np.linalg.eigh(covariance[np.ix_(finite, finite)])
    keep = value > 0
    kept = [e for e, k in zip(estimates, finite, strict=True) if k]
    return kept, vector[:, keep] * np.sqrt(value[keep])


def _add(
    off: Members, estimate: Estimate, size: float, friction: Friction, mechanism: Mechanism
) -> None:
    """Add to one parameter of a member; those of servos change no torque that is logged."""
    place = place_of(friction, estimate.block, estimate.parameter, estimate.joint)
    if place is not None:
        off.theta[place] += size
    elif estimate.block == "inertia":
        off.base[mechanism.base_names.index(estimate.name)] += size
    elif estimate.block in _SENSORS:
        values = getattr(off, estimate.block)
        values[() if estimate.joint is None or values.ndim == 0 else estimate.joint] += size
