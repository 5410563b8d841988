"""The level of sliding friction that laws share: Coulomb, and a peak that falls off with speed.

A law has one level, or one for each direction (`SIDES`): `_positive` ones hold for w > 0,
`_negative` ones elsewhere; both are positive numbers.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.config import Positive
from frictionid.errors import InputError

Range = tuple[float, float]
Speeds = Annotated[tuple[Positive, ...], Field(min_length=2)]  # [rad/s], see `check_increasing`

LEVEL: Range = (0.0, float("inf"))
# fits bound velocities by what the data resolve, see `friction.constraints`
VELOCITY: Range = (0.0, float("inf"))
# a factor of 1.5 apart: the best of them lies in the valley of the best fit
VELOCITIES = tuple(float(f"{0.4 * 1.5**k:.2g}") for k in range(-17, 14))
# a factor of 2.5 apart, for laws with a second parameter that is not linear
COARSE_VELOCITIES = tuple(float(f"{0.5 * 2.5**k:.2g}") for k in range(-7, 6))
SIDES = ("_positive", "_negative")


class StribeckLevel(NamedTuple):
    """Level coulomb + peak exp(-(s/stribeck_velocity)^2) at a speed s, for some `sides`.

    Its parameters come first in theta: coulomb of each side, peak of each side, stribeck_velocity.

    >>> StribeckLevel(SIDES).names[:2]
    ('coulomb_positive', 'coulomb_negative')
    """

    sides: tuple[str, ...] = ("",)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters."""
        levels = (f"{name}{side}" for name in ("coulomb", "peak") for side in self.sides)
        return (*levels, "stribeck_velocity")

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return ("N m",) * (2 * len(self.sides)) + ("rad/s",)

    @property
    def bounds(self) -> tuple[Range, ...]:
        """Their bounds."""
        return (LEVEL,) * (2 * len(self.sides)) + (VELOCITY,)

    def start(self, velocity: float) -> tuple[float, ...]:
        """Values to start a fit from: there its first step is linear least squares."""
        return (0.0,) * (2 * len(self.sides)) + (velocity,)

    def at(self, theta: Array, speed: Array, w: Array) -> Array:
        """Level (..., n) [N m] at a speed, in the direction of w."""
        n, left = len(self.sides), stribeck_factor(speed, theta[..., 2 * len(self.sides)])
        return on_side(w, *(theta[..., i] + theta[..., n + i] * left for i in range(n)))

    def at_rest(self, theta: Array, w: Array) -> Array:
        """Break-away level (..., n) [N m] in the direction of w."""
        n = len(self.sides)
        return on_side(w, *(theta[..., i] + theta[..., n + i] for i in range(n))) + 0.0 * w

    def mean_at_rest(self, theta: Array) -> Array:
        """Mean break-away level (..., n) [N m] of the sides."""
        n = len(self.sides)
        total: Any = sum(theta[..., i] for i in range(2 * n))
        return total / n

    def gradient(self, theta: Array, w: Array, sign: Array) -> list[Array]:
        """Derivatives (..., n) of level(|w|) sign in its parameters."""
        n, ws = len(self.sides), theta[..., 2 * len(self.sides)]
        left, signs = stribeck_factor(w, ws), by_side(w, sign, n)
        peaks = sum(theta[..., n + i] * side for i, side in enumerate(signs))
        by_velocity = peaks * left * (2.0 * w**2 / ws**3)
        zero = 0.0 * by_velocity
        return [*(side + zero for side in signs), *(side * left for side in signs), by_velocity]


def stribeck_level(symmetric: bool) -> StribeckLevel:
    """One level for both directions, or one for each."""
    return StribeckLevel() if symmetric else StribeckLevel(SIDES)


def stribeck_factor(speed: Array, velocity: Any) -> Array:
    """exp(-(speed/velocity)^2): what is left of a peak at a speed.

    >>> import numpy as np
    >>> stribeck_factor(np.array([0.0, 2.0]), np.array(2.0)).round(3)
    array([1.   , 0.368])
    """
    return namespace(speed, velocity).exp(-((speed / velocity) ** 2))


def above_zero(level: Array) -> Array:
    """The level, or zero where it is negative: friction does not drive.

    >>> import numpy as np
    >>> above_zero(np.array([-1.0, 2.0]))
    array([-0.,  2.])
    """
    return namespace(level).maximum(level, 0.0 * level)


def on_side(w: Array, *sides: Array) -> Array:
    """Of two arrays the first where w > 0, the second elsewhere; a single one as it is.

    >>> import numpy as np
    >>> on_side(np.array([-1.0, 0.0, 1.0]), np.array(5.0), np.array(3.0))
    array([3., 3., 5.])
    """
    return namespace(w, *sides).where(w > 0, *sides) if len(sides) > 1 else sides[0]


def by_side(w: Array, values: Array, sides: int = 2) -> list[Array]:
    """Values where w > 0 and zero elsewhere, and the other way round; for one side, as they are.

    >>> import numpy as np
    >>> by_side(np.array([-1.0, 1.0]), np.array([2.0, 3.0]))
    [array([0., 3.]), array([2., 0.])]
    """
    zero = 0.0 * values
    return [values] if sides == 1 else [on_side(w, values, zero), on_side(w, zero, values)]


def check_increasing(name: str, speeds: tuple[float, ...]) -> None:
    """Refuse speeds that do not increase.

    Raises
    ------
    InputError
        Naming the law, its setting and the values.

    >>> check_increasing("Spline: knots", (2.0, 1.0))
    Traceback (most recent call last):
    frictionid.errors.InputError: Spline: knots = [2.0, 1.0] rad/s must increase
    """
    if not all(a < b for a, b in pairwise(speeds)):
        raise InputError(f"{name} = {list(speeds)} rad/s must increase")
