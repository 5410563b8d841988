"""Dahl friction: a spring before the joint slips, Coulomb friction after it, and nothing sticks."""

from __future__ import annotations

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.levels import LEVEL
from frictionid.friction.laws.motor_load import SHARE
from frictionid.friction.smooth_sign import smooth_sign


def bristle_relaxation(w: Array, steady: Array, dt: Array) -> tuple[Array, Array]:
    """Where bristles bend at the velocity w, and the share of the way that is left after dt.

    The exact solution: it neither overshoots nor limits the step.

    >>> import numpy as np
    >>> target, left = bristle_relaxation(np.array([1.0]), np.array([0.01]), np.array([0.01]))
    >>> target, left.round(3)
    (array([0.01]), array([0.368]))
    """
    xp = namespace(w, steady)
    return xp.sign(w) * steady, xp.exp(-xp.abs(w) * dt / steady)


def bristle_rate(z: Array, w: Array, steady: Array) -> Array:
    """dz/dt at the velocity w [rad/s].

    >>> import numpy as np
    >>> bristle_rate(np.array([0.0, 0.01]), np.array([1.0, 1.0]), np.array([0.01, 0.01]))
    array([1., 0.])
    """
    return w - namespace(w).abs(w) * z / steady


PRESLIDING = (1e-5, 1.0)  # [rad]
PRESLIDINGS = (0.002, 0.006, 0.02, 0.06)


@dataclass(frozen=True)
class Dahl(Law):
    """Tf = coulomb z/presliding + viscous w, with dz/dt = w - |w| z/presliding [Dahl1968].

    `presliding` is the angle by which the joint gives before it slips: its stiffness is coulomb /
    presliding [N m/rad]. Memory is the bend z [rad]. It starts as in steady sliding; of a joint at
    rest the bend is not known, and is taken to grow over `width` [rad/s]. At rest the spring holds
    the joint, there is no break-away level.

    motor_load : true lets the level grow with the motor torque u, coulomb + loss |u|, as in
        `MotorLoad`: the spring is stiffer under load
    """

    width: float = 0.02
    shape: str = "tanh"
    motor_load: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        return ("coulomb", "viscous", "presliding", *(("loss",) if self.motor_load else ()))

    @property
    def units(self) -> tuple[str, ...]:
        return ("N m", "N m s/rad", "rad", *(("1",) if self.motor_load else ()))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return (LEVEL, LEVEL, PRESLIDING, *((SHARE,) if self.motor_load else ()))

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        loss = (0.0,) if self.motor_load else ()
        return tuple((0.0, 0.0, z, *loss) for z in PRESLIDINGS)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (theta[..., 2] * smooth_sign(x.w, self.width, self.shape),)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = theta[..., 0]
        if self.motor_load:
            level = level + theta[..., 3] * namespace(x.u).abs(x.u)
        return level * memory[0] / theta[..., 2] + theta[..., 1] * x.w

    def relaxation(self, theta: Array, x: Inputs, dt: Array) -> tuple[Array, Array]:
        return bristle_relaxation(x.w, theta[..., 2], dt)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def sharpened(self) -> Law:
        """The law itself: its smoothing says how the bristles start, they hold the joint."""
        return self
