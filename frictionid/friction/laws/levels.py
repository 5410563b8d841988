"""What laws share: parameters of the same meaning, and levels that differ by direction.

A law has one level, or one for each direction (`SIDES`): `_positive` ones hold for w > 0,
`_negative` ones elsewhere; both are positive numbers.
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.config import Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Law, LawParameter, Memory

Speeds = Annotated[tuple[Positive, ...], Field(min_length=2)]  # [rad/s], see `check_increasing`

# a factor of 1.5 apart: the best of them lies in the valley of the best fit
VELOCITIES = tuple(float(f"{0.4 * 1.5**k:.2g}") for k in range(-17, 14))
# a factor of 2.5 apart, for laws with a second parameter that is not linear
COARSE_VELOCITIES = tuple(float(f"{0.5 * 2.5**k:.2g}") for k in range(-7, 6))
SIDES = ("_positive", "_negative")

COULOMB = LawParameter("coulomb", "N m")
PEAK = LawParameter("peak", "N m", size=0.5)
VISCOUS = LawParameter("viscous", "N m s/rad")
DRAG = LawParameter("drag", "N m s^2/rad^2", size=1.0)
LOSS = LawParameter("loss", "1", high=1.0, size=0.3)
LOAD = LawParameter("load_coefficient", "N m/N", size=1.0)


def by_direction(symmetric: bool, *parameters: LawParameter) -> tuple[LawParameter, ...]:
    """Parameters of both directions together, or each of them for one direction after the other.

    >>> [p.name for p in by_direction(False, COULOMB)]
    ['coulomb_positive', 'coulomb_negative']
    """
    sides = ("",) if symmetric else SIDES
    return tuple(p._replace(name=f"{p.name}{side}") for p in parameters for side in sides)


def stem(name: str) -> str:
    """Name of a parameter, whatever the direction.

    >>> stem("peak_negative"), stem("viscous")
    ('peak', 'viscous')
    """
    return name.removesuffix(SIDES[0]).removesuffix(SIDES[1])


def no_limit(law: Law, theta: Array, x: Inputs, memory: Memory) -> Array:  # noqa: ARG001
    """The break-away level, zero, of laws that a joint at rest does not feel as a level."""
    return 0.0 * (theta[..., 0] + x.w)


class Level(NamedTuple):
    """Level coulomb + peak exp(-(s/stribeck_velocity)^2) [N m] at a speed s.

    Its parameters come first in theta: coulomb and peak of each direction, stribeck_velocity.

    symmetric : whether it is the same in both directions
    peaked : whether there is a peak at all
    velocities : [rad/s], where fits of stribeck_velocity start
    """

    symmetric: bool = True
    peaked: bool = True
    velocities: tuple[float, ...] = VELOCITIES

    @property
    def sides(self) -> int:
        """Number of levels."""
        return 1 if self.symmetric else 2

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        """Its parameters; fits start without friction, so that a first step is linear."""
        coulomb = by_direction(self.symmetric, COULOMB)
        if not self.symmetric:  # a direction without motion is like the other one
            up, down = coulomb
            coulomb = (up._replace(size=0.5, like=down.name), down._replace(size=0.5, like=up.name))
        if not self.peaked:
            return coulomb
        # fits bound velocities by what the data resolve, see `friction.constraints`
        velocity = LawParameter("stribeck_velocity", "rad/s", initial=self.velocities)
        return (*coulomb, *by_direction(self.symmetric, PEAK), velocity)

    def at(self, theta: Array, speed: Array, w: Array) -> Array:
        """Level (..., n) [N m] at a speed, in the direction of w."""
        n = self.sides
        if not self.peaked:
            return on_side(w, *(theta[..., i] for i in range(n)))
        left = stribeck_factor(speed, theta[..., 2 * n])
        return on_side(w, *(theta[..., i] + theta[..., n + i] * left for i in range(n)))

    def at_rest(self, theta: Array, w: Array) -> Array:
        """Break-away level (..., n) [N m] in the direction of w."""
        n, rest = self.sides, 0.0 * w
        if not self.peaked:
            return self.at(theta, w, w) + rest
        return on_side(w, *(theta[..., i] + theta[..., n + i] for i in range(n))) + rest

    def mean_at_rest(self, theta: Array) -> Array:
        """Mean break-away level (..., n) [N m] of the sides."""
        n = self.sides
        total: Any = sum(theta[..., i] for i in range(2 * n))
        return total / n

    def gradient(self, theta: Array, w: Array, sign: Array) -> list[Array]:
        """Derivatives (..., n) of level(|w|) sign in its parameters."""
        n, signs = self.sides, by_side(w, sign, self.sides)
        if not self.peaked:
            return signs
        ws = theta[..., 2 * n]
        left = stribeck_factor(w, ws)
        peaks = sum(theta[..., n + i] * side for i, side in enumerate(signs))
        return [*signs, *(side * left for side in signs), peaks * left * (2.0 * w**2 / ws**3)]


class Term(NamedTuple):
    """A parameter and its factor, which is in the level where the term is `rubbing`."""

    parameter: LawParameter
    factor: Callable[[Inputs], Array]
    rubbing: bool = False


VISCOUS_TERM = Term(VISCOUS, lambda x: x.w)
DRAG_TERM = Term(DRAG, lambda x: x.w * namespace(x.w).abs(x.w))


@dataclass(frozen=True)
class LevelLaw(Law):
    """Tf = (level(|w|) + sum_i theta_i f_i) sgn(w) + sum_j theta_j f_j, break-away at the level.

    i are the rubbing terms, j all others. Of theta the parameters of the level come first.
    """

    width: float = 0.02
    shape: str = "tanh"

    @property
    @abstractmethod
    def level(self) -> Level:
        """The level without its terms."""

    @property
    @abstractmethod
    def terms(self) -> tuple[Term, ...]:
        """All terms, in the order of theta."""

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        return (*self.level.parameters, *(term.parameter for term in self.terms))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self._with_terms(self.level.at(theta, x.w, x.w), theta, x, rubbing=True)
        torque = level * self.sign(x.w)
        return self._with_terms(torque, theta, x, rubbing=False)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._with_terms(self.level.at_rest(theta, x.w), theta, x, rubbing=True)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = self.sign(x.w) + zero
        columns = self.level.gradient(theta, x.w, sign)
        columns += [t.factor(x) * sign if t.rubbing else t.factor(x) + zero for t in self.terms]
        return namespace(zero).stack(columns, axis=-1)

    def _with_terms(self, value: Array, theta: Array, x: Inputs, rubbing: bool) -> Array:
        for place, term in enumerate(self.terms, -len(self.terms)):
            if term.rubbing is rubbing:
                value = value + theta[..., place] * term.factor(x)
        return value


@dataclass(frozen=True)
class NoFriction(Law):
    """Tf = 0. It has no parameters: theta has shape (..., n, 0)."""

    kind = "none"
    parameters: ClassVar = ()

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * x.w + theta.sum(-1)  # the empty sum is zero and carries theta's batch axes

    def gradient(self, theta: Array, x: Inputs) -> Array:
        return (0.0 * x.w)[..., None] + theta

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self.torque(theta, x, ())


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
    """Raise InputError, with the name of a law's setting, for speeds that do not increase.

    >>> check_increasing("Spline: knots", (2.0, 1.0))
    Traceback (most recent call last):
    frictionid.errors.InputError: Spline: knots = [2.0, 1.0] rad/s must increase
    """
    if not all(a < b for a, b in pairwise(speeds)):
        raise InputError(f"{name} = {list(speeds)} rad/s must increase")
