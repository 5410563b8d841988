"""Spring: a torque that grows with a joint's position, whatever the velocity.

Tf = stiffness q + preload

A cable, a hose, a flexure or a balancing spring pulls the joint towards where it is slack, at
q = -preload/stiffness, as the springs of joints in [MuJoCo2026]. This is no friction: it gives back
what it takes, and a joint at rest has it as well. Beside friction it is a part of a `sum`.
"""

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, LawParameter, Memory


@dataclass(frozen=True)
class Spring(Law):
    """Tf = stiffness q + preload, of a cable or a spring.

    It is the same in both directions and at rest, where it adds to the load that friction holds.
    `stiffness` is what the torque grows by with the position. `preload` is the torque at position
    zero; a bias of the torque sensor looks like it.
    Part of a sum: `laws = ["coulomb_viscous", "spring"]`.

    >>> import numpy as np
    >>> from frictionid.friction import at_rest
    >>> x = at_rest(np.zeros(1))._replace(q=np.array([0.5]))
    >>> Spring().torque(np.array([[4.0, -1.0]]), x, ())
    array([1.])
    """

    @property
    def parameters(self) -> tuple[LawParameter, ...]:
        endless = -float("inf")
        return (
            LawParameter("stiffness", "N m/rad", endless, optional=True),
            LawParameter("preload", "N m", endless, optional=True),
        )

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return theta[..., 0] * x.q + theta[..., 1] + 0.0 * x.w

    def gradient(self, theta: Array, x: Inputs) -> Array:
        none = 0.0 * (theta[..., 0] + x.w)
        return namespace(theta, x.w).stack([x.q + none, 1.0 + none], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return namespace(x.w).sign(x.w) * self.torque(theta, x, memory)
