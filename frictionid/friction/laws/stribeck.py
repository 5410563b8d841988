"""The classical laws: a level of sliding friction, which may fall from break-away, and drag.

Tf = (Fc + Fp exp(-(w/ws)^2)) sgn(w) + Fv w, break-away at Fc + Fp [Olsson1998].
"""

from dataclasses import dataclass
from typing import ClassVar

from .levels import DRAG_TERM, VISCOUS_TERM, Level, LevelLaw


@dataclass(frozen=True)
class Stribeck(LevelLaw):
    """Tf = (coulomb + peak exp(-(w/stribeck_velocity)^2)) sgn(w) + viscous w.

    `peak` is the break-away minus the Coulomb level; sgn is smoothed over `width`.

    symmetric : false gives each direction a Coulomb level and a peak; the Stribeck velocity and the
        viscous coefficient are shared
    """

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

    level: ClassVar = Level(peaked=False)
    terms: ClassVar = (VISCOUS_TERM, DRAG_TERM)
