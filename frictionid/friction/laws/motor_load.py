"""Friction of a gear that rubs the more, the more motor torque it transmits [Duclusaud2025]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs
from frictionid.friction.law import LinearLaw
from frictionid.friction.laws.levels import LEVEL, Range

SHARE: Range = (0.0, 1.0)


@dataclass(frozen=True)
class MotorLoad(LinearLaw):
    """Tf = (coulomb + loss |u|) sgn(w) + viscous w, with sgn smoothed over `width`.

    `loss` is the share of the motor torque u that the gear swallows: it passes on 1 - loss of it
    while the motor drives, and holds back 1 + loss of it while it brakes. Without motor torque this
    is Coulomb and viscous friction. Where torque is fitted by Coulomb and viscous friction alone,
    the Coulomb level takes up the mean loss and is too high for motions with less torque.

    squared : true adds `rise` u^2 to the level: more is lost the harder the motor pulls. It may
        stand for the gear, and for what weakens the motor at high currents and is in no log: a
        supply that gives in, heat, saturation
    """

    width: float = 0.02
    shape: str = "tanh"
    squared: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return ("coulomb", "viscous", "loss", *(("rise",) if self.squared else ()))

    @property
    def units(self) -> tuple[str, ...]:
        return ("N m", "N m s/rad", "1", *(("1/(N m)",) if self.squared else ()))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (LEVEL, LEVEL, SHARE, *((LEVEL,) if self.squared else ()))

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        first: dict[int, Array | float] = {0: 1.0, 2: namespace(x.u).abs(x.u)}
        return first | {3: x.u**2} if self.squared else first

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {1: x.w}
