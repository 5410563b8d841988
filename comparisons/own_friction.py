"""A friction law of one's own: Coulomb friction and a drag that grows with velocity squared."""

from dataclasses import dataclass

import numpy as np

from frictionid.identifiers import LeastSquares


@dataclass(frozen=True)
class Quadratic:
    """Tf = coulomb sgn(w) + drag w |w|, with sgn smoothed over `width` [rad/s]."""

    width: float = 0.02
    names = ("coulomb", "drag")
    units = ("N m", "N m s^2/rad^2")
    bounds = ((0.0, np.inf), (0.0, np.inf))
    initial = ((0.0, 0.0),)
    sample_time = None  # only laws with memory have one
    uses_load = False

    def start(self, theta, x):
        return ()  # no memory

    def torque(self, theta, x, memory):
        return theta[..., 0] * np.tanh(x.w / self.width) + theta[..., 1] * x.w * abs(x.w)

    def advance(self, theta, x, memory, dt):
        return memory

    def limit(self, theta, x, memory):
        return theta[..., 0] + 0.0 * x.w


def quadratic(width=0.02):
    """Identifier of the law, for suites: kind = "own_friction:quadratic"."""
    return LeastSquares(Quadratic(width))
