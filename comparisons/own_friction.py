"""A friction law of one's own: Coulomb and viscous friction, and a drag that grows with w^2."""

from dataclasses import dataclass

import numpy as np

from frictionid.fitting.identifiers import LeastSquares
from frictionid.friction import Law


@dataclass(frozen=True)
class Quadratic(Law):
    """Tf = coulomb sgn(w) + viscous w + drag w |w|, with sgn smoothed over `width` [rad/s]."""

    width: float = 0.02
    names = ("coulomb", "viscous", "drag")
    units = ("N m", "N m s/rad", "N m s^2/rad^2")
    bounds = ((0.0, np.inf),) * 3

    def torque(self, theta, x, memory):
        level = theta[..., 0] * np.tanh(x.w / self.width)
        return level + theta[..., 1] * x.w + theta[..., 2] * (x.w * abs(x.w))

    def limit(self, theta, x, memory):
        return theta[..., 0] + 0.0 * x.w  # at break-away


def quadratic(width=0.02):
    """Identifier of the law, for suites: kind = "own_friction:quadratic"."""
    return LeastSquares(Quadratic(width))
