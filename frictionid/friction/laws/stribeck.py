"""The classical laws: a level of sliding friction, which may fall from break-away, and drag.

Tf = (Fc + Fp exp(-(w/ws)^2)) sgn(w) + Fv w, break-away at Fc + Fp [Olsson1998].
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, LawParameter, Memory
from frictionid.friction.laws.levels import DRAG, VISCOUS, Level
from frictionid.friction.smooth_sign import smooth_sign


class Term(NamedTuple):
    """A parameter and its factor, which is in the level where the term is `rubbing`."""

    parameter: LawParameter
    factor: Callable[[Inputs], Array]
    rubbing: bool = False


VISCOUS_TERM = Term(VISCOUS, lambda x: x.w)
DRAG_TERM = Term(DRAG, lambda x: x.w * namespace(x.w).abs(x.w))


class LevelLaw(Law):
    """Tf = (level(|w|) + sum_i theta_i f_i) sgn(w) + sum_j theta_j f_j, break-away at the level.

    i are the rubbing terms, j all others. Of theta the parameters of the level come first.
    """

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

    @property
    def is_linear(self) -> bool:  # type: ignore[override]
        """Whether there is no peak, whose velocity is not linear."""
        return not self.level.peaked

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self._with_terms(self.level.at(theta, x.w, x.w), theta, x, rubbing=True)
        torque = level * smooth_sign(x.w, self.width, self.shape)
        return self._with_terms(torque, theta, x, rubbing=False)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return self._with_terms(self.level.at_rest(theta, x.w), theta, x, rubbing=True)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = smooth_sign(x.w, self.width, self.shape) + zero
        columns = self.level.gradient(theta, x.w, sign)
        columns += [t.factor(x) * sign if t.rubbing else t.factor(x) + zero for t in self.terms]
        return namespace(zero).stack(columns, axis=-1)

    def _with_terms(self, value: Array, theta: Array, x: Inputs, rubbing: bool) -> Array:
        for place, term in enumerate(self.terms, -len(self.terms)):
            if term.rubbing is rubbing:
                value = value + theta[..., place] * term.factor(x)
        return value


@dataclass(frozen=True)
class Stribeck(LevelLaw):
    """Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2)) sgn(w) + viscous w.

    `peak` is the break-away minus the Coulomb level; sgn is smoothed over `width`.

    symmetric : false gives each direction a Coulomb level and a peak; the Stribeck velocity and the
        viscous coefficient are shared
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True
    terms: ClassVar = (VISCOUS_TERM,)

    @property
    def level(self) -> Level:
        return Level(self.symmetric)


@dataclass(frozen=True)
class CoulombViscous(LevelLaw):
    """Tf = coulomb sgn(w) + viscous w, with sgn smoothed over `width`.

    The physics step holds a joint at rest by itself; the width only has to be well below the
    velocities of interest [Olsson1998].

    symmetric : false gives each direction a Coulomb level, `coulomb_positive` for w > 0 and
        `coulomb_negative` for w < 0; both are positive numbers
    """

    width: float = 0.02
    shape: str = "tanh"
    symmetric: bool = True
    terms: ClassVar = (VISCOUS_TERM,)

    @property
    def level(self) -> Level:
        return Level(self.symmetric, peaked=False)


@dataclass(frozen=True)
class Quadratic(LevelLaw):
    """Tf = coulomb sgn(w) + viscous w + drag w |w|, with sgn smoothed over `width`.

    The drag is that of the air, or of oil that is churned; it may also stand for what the torque
    constant of a motor loses with its speed.
    """

    width: float = 0.02
    shape: str = "tanh"
    level: ClassVar = Level(peaked=False)
    terms: ClassVar = (VISCOUS_TERM, DRAG_TERM)


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
