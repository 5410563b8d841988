"""Friction of a joint whose motor is connected: its motion induces a torque against itself."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array
from frictionid.dynamics.sliding_friction import SLOW
from frictionid.friction import Inputs, Law, Memory

_SHARPER = 0.2  # of the smoothing of the base law


@dataclass(frozen=True)
class BackEMF(Law):
    """Tf = Tf_base + back_emf w, where the base law sees the torque u - back_emf w of the motor.

    u is the torque that the voltage alone would make. The last number of a joint is back_emf =
    kt^2/R [N m s/rad], all others are the base law's.
    """

    base: Law
    shape = ""  # the step must not narrow it, see `sharpened`

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.base.names, "back_emf")

    @property
    def units(self) -> tuple[str, ...]:
        return (*self.base.units, "N m s/rad")

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (*self.base.bounds, (0.0, float("inf")))

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple((*start, 0.0) for start in self.base.initial)

    @property
    def sample_time(self) -> float | None:  # type: ignore[override]
        return self.base.sample_time

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        return self.base.uses_load

    @property
    def width(self) -> float:  # type: ignore[override]
        """Smoothing [rad/s] of the base law."""
        return self.base.width

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.base.start(theta[..., :-1], _felt(theta, x))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        own: Array = self.base.torque(theta[..., :-1], _felt(theta, x), memory)
        return own + theta[..., -1] * x.w

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.base.advance(theta[..., :-1], _felt(theta, x), memory, dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        # w says nothing but the direction here: the joint is at rest
        level: Array = self.base.limit(theta[..., :-1], x, memory)
        return level


def _felt(theta: Array, x: Inputs) -> Inputs:
    return x._replace(u=x.u - theta[..., -1] * x.w)


def sharpened(law: Law) -> Law:
    """The law with a smoothing so narrow that the step asks it at the joint's own velocity.

    Where the step goes round a law's smoothing it asks for the torque at a speed just beyond. That
    is no matter for friction, which hardly changes there, but back-EMF changes more.
    """
    if not 0 < 5 * law.width <= SLOW * (1 + 1e-9):
        return law
    return law.with_width(_SHARPER * law.width)
