"""The level of sliding friction that laws share: Coulomb, and a peak that falls off with speed."""

from __future__ import annotations

from frictionid.arrays import Array, namespace

Range = tuple[float, float]

LEVEL: Range = (0.0, float("inf"))
# slower dips hide where joints come to rest and are never seen, faster ones are levels themselves
VELOCITY: Range = (0.3, 30.0)
# a factor of 1.8 apart: the best of them lies in the valley of the best fit
VELOCITIES = (0.4, 0.7, 1.2, 2.0, 3.5, 6.5, 11.0, 20.0)


def stribeck_factor(speed: Array, velocity: Array) -> Array:
    """exp(-(speed/velocity)^2): what is left of a peak at a speed.

    >>> import numpy as np
    >>> stribeck_factor(np.array([0.0, 2.0]), np.array(2.0)).round(3)
    array([1.   , 0.368])
    """
    return namespace(speed, velocity).exp(-((speed / velocity) ** 2))


def level(theta: Array, speed: Array) -> Array:
    """Level at a speed >= 0 [N m]; theta begins with coulomb, peak, stribeck_velocity."""
    return theta[..., 0] + theta[..., 1] * stribeck_factor(speed, theta[..., 2])


def level_by_direction(theta: Array, speed: Array, w: Array) -> Array:
    """Level at a speed in the direction of w [N m], of the positive side only where w > 0.

    theta begins with coulomb and peak for each side, as in `AsymmetricStribeck`.
    """
    left = stribeck_factor(speed, theta[..., 4])
    return by_direction(
        w, theta[..., 0] + theta[..., 2] * left, theta[..., 1] + theta[..., 3] * left
    )


def above_zero(level: Array) -> Array:
    """The level, or zero where it is negative: friction does not drive.

    >>> import numpy as np
    >>> above_zero(np.array([-1.0, 2.0]))
    array([-0.,  2.])
    """
    return namespace(level).maximum(level, 0.0 * level)


def by_direction(w: Array, positive: Array, negative: Array) -> Array:
    """Entries of `positive` where w > 0, of `negative` elsewhere.

    >>> import numpy as np
    >>> by_direction(np.array([-1.0, 0.0, 1.0]), np.array(5.0), np.array(3.0))
    array([3., 3., 5.])
    """
    return namespace(w, positive, negative).where(w > 0, positive, negative)


def directions(w: Array, values: Array) -> tuple[Array, Array]:
    """Values where w > 0 and zero elsewhere, and the other way round.

    >>> import numpy as np
    >>> directions(np.array([-1.0, 1.0]), np.array([2.0, 3.0]))
    (array([0., 3.]), array([2., 0.]))
    """
    zero = 0.0 * values
    return by_direction(w, values, zero), by_direction(w, zero, values)
