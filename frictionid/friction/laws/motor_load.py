"""Friction of a gear that rubs the more, the more motor torque it transmits [Duclusaud2025]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

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
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "viscous", "loss")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m s/rad", "1")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL, LEVEL, SHARE)

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        return {0: 1.0, 2: namespace(x.u).abs(x.u)}

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {1: x.w}


@dataclass(frozen=True)
class MotorLoadQuadratic(LinearLaw):
    """Tf = (coulomb + loss |u| + rise u^2) sgn(w) + viscous w, sgn smoothed over `width`.

    Beyond the share `loss` of the motor torque u that a gear swallows (see `MotorLoad`), more of it
    is lost the harder the motor pulls. `rise` may stand for the gear, and for what weakens the
    motor at high currents and is in no log: a supply that gives in, heat, saturation.
    """

    width: float = 0.02
    shape: str = "tanh"
    names: ClassVar[tuple[str, ...]] = ("coulomb", "viscous", "loss", "rise")
    units: ClassVar[tuple[str, ...]] = ("N m", "N m s/rad", "1", "1/(N m)")
    bounds: ClassVar[tuple[tuple[float, float], ...]] = (LEVEL, LEVEL, SHARE, LEVEL)

    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        return {0: 1.0, 2: namespace(x.u).abs(x.u), 3: x.u**2}

    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        return {1: x.w}
