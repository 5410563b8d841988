"""A law within the speeds that were measured, and a straight line beyond them.

Tf = law(w) where |w| <= speed, law(+-speed) + slope (w -+ speed) beyond
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from frictionid.arrays import Array, like, namespace
from frictionid.config import Positive
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.law import WrappedLaw

_LAST = 0.01  # of the speed: the line goes on as the last per cent of the curve


@dataclass(frozen=True)
class LinearOutside(WrappedLaw):
    """The law `law` up to a speed of each joint [rad/s], and from there on a straight line.

    Data say nothing of faster motion, and an exported friction must say something. The line goes
    on with the slope of the last per cent of the speeds. It never falls, so that it cannot come to
    drive. Memory advances as at the last measured speed.

    >>> import numpy as np
    >>> from frictionid.friction import Friction
    >>> from frictionid.friction.laws import Quadratic
    >>> law = LinearOutside(Quadratic(), (2.0,))
    >>> theta = np.array([[0.1, 0.0, 0.01]])
    >>> Friction(law, theta).curve(np.array([1.0, 2.0, 4.0]))[:, 0].round(3)
    array([0.11, 0.14, 0.22])
    """

    speeds: Annotated[tuple[Positive, ...], Field(min_length=1)]
    kind = ""

    @property
    def is_network(self) -> bool:  # type: ignore[override]
        """Whether the law is."""
        return self.law.is_network

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        top = self._top(x.w)
        inside = self._inside(x)

        def slope(side: float) -> Array:
            near, end = (
                self.law.torque(theta, x._replace(w=share * top + 0.0 * inside.w), memory)
                for share in (side * (1.0 - _LAST), side)
            )
            rise = (end - near) / (side * _LAST * top)
            return namespace(rise).maximum(rise, 0.0 * rise)

        within = self.law.torque(theta, inside, memory)
        beyond = x.w - inside.w
        return within + namespace(x.w).where(x.w > 0, slope(1.0), slope(-1.0)) * beyond

    def start(self, theta: Array, x: Inputs) -> Memory:
        return self.law.start(theta, self._inside(x))

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return self.law.advance(theta, self._inside(x), memory, dt)

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array] | None:
        return self.law.relaxation(theta, self._inside(x), dt)

    def sharpened(self) -> Law:
        """The same of the sharpened law."""
        return LinearOutside(self.law.sharpened(), self.speeds)

    def _top(self, w: Array) -> Array:
        return like(self.speeds, w)

    def _inside(self, x: Inputs) -> Inputs:
        xp, top = namespace(x.w), self._top(x.w)
        return x._replace(w=xp.minimum(xp.maximum(x.w, -top), top))
