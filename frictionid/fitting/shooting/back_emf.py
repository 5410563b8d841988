"""Friction of a joint whose motor is connected: its motion induces a torque against itself."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array
from frictionid.dynamics.tangent.smoothed_law import SmoothedLaw
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.law import NUMERICAL_WIDTH

_SHARPER = 0.2  # of the smoothing of the other law


@dataclass(frozen=True, eq=False, repr=False)
class BackEMF(SmoothedLaw):
    """Tf = Tf_law + back_emf w, where the other law sees the torque u - back_emf w of the motor.

    u is the torque that the voltage alone would make. The last number of a joint is back_emf =
    kt^2/R [N m s/rad], all others are the other law's. The step must not narrow its smoothing, see
    `with_back_emf`.
    """

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.law.names, "back_emf")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.law.units, "N m s/rad")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.law.bounds, (0.0, float("inf")))

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple((*start, 0.0) for start in self.law.initial)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.law.start(theta[..., :-1], _felt(theta, x))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        own: Array = self.law.torque(theta[..., :-1], _felt(theta, x), memory)
        return own + theta[..., -1] * x.w

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.law.advance(theta[..., :-1], _felt(theta, x), memory, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        # w says nothing but the direction here: the joint is at rest
        level: Array = self.law.limit(theta[..., :-1], x, memory)
        return level


def _felt(theta: Array, x: Inputs) -> Inputs:
    return x._replace(u=x.u - theta[..., -1] * x.w)


def with_back_emf(law: Law) -> BackEMF:
    """The law with back-EMF, its smoothing so narrow that the step asks at the joint's velocity.

    Where the step goes round a law's smoothing it asks for the torque at a speed just beyond. That
    does not matter for friction, which hardly changes there, but back-EMF changes more.
    """
    if 0 < law.width <= NUMERICAL_WIDTH:
        law = law.with_width(_SHARPER * law.width)
    return BackEMF(law, law.width, "")
