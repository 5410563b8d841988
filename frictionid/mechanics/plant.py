"""A mechanism with its parameters, as the physics step needs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array, like, namespace
from frictionid.mechanics.mechanism import Mechanism, Terms

SLOW = 0.1  # [rad/s]: slower joints may come to rest


@dataclass(frozen=True)
class Plant:
    """A mechanism with physical parameters and the base parameters p that follow from them.

    `parameters` are arrays of one batch shape (...), often one entry per recording or row; p has
    shape (..., nb). An index into a plant picks from the batch. `slow` has a speed of each joint
    [rad/s or m/s], below which it may come to rest: 0.1 where no motion says better. `temperature`
    (..., n) [degC] is that of the joints, for friction that depends on it.

    >>> import numpy as np
    >>> from frictionid.mechanics import pendulum
    >>> Plant.from_parameters(pendulum(), {"mass": np.array([0.5, 1.0])})[1].p
    array([1.  , 9.81])
    """

    mechanism: Mechanism
    parameters: Mapping[str, Array]
    p: Array
    slow: tuple[float, ...] = ()
    temperature: Array | None = None

    def __post_init__(self) -> None:
        if not self.slow:
            object.__setattr__(self, "slow", (SLOW,) * self.mechanism.n)

    @staticmethod
    def from_parameters(mechanism: Mechanism, parameters: Mapping[str, Any]) -> Plant:
        """Plant of physical parameters, missing ones at their defaults; SI units."""
        values = {**mechanism.defaults, **parameters}
        xp = namespace(*values.values())
        # not asarray on tensors, which would cut off their gradient
        arrays = xp.broadcast_arrays(
            *(
                v if hasattr(v, "detach") else xp.asarray(v, dtype=xp.float64)
                for v in values.values()
            )
        )
        full = dict(zip(values, arrays, strict=True))
        return Plant(mechanism, full, mechanism.base(full))

    def __getitem__(self, index: Any) -> Plant:
        physical = {k: v[index] for k, v in self.parameters.items()}
        warm = None if self.temperature is None else self.temperature[index]
        return Plant(self.mechanism, physical, self.p[index], self.slow, warm)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.mechanism.n

    @property
    def parts(self) -> int:
        """Number of parts with friction: joints, and those that turn with several of them."""
        return len(self.mechanism.friction_names)

    def slow_like(self, w: Array) -> Array:
        """`slow` as an array like velocities w (..., n) of the joints, or (..., m) of all parts."""
        slow = np.array(self.slow)
        if w.shape[-1] > self.n:  # a part is slow where all joints that turn it are
            slow = np.abs(self.mechanism.friction_map) @ slow
        return like(slow, w)

    def terms(self, q: Array, w: Array) -> Terms:
        """Terms of the equations of motion, see `Terms`."""
        return self.mechanism.terms(self.p, q, w)

    def dynamics(self, q: Array, w: Array) -> tuple[Array, Array]:
        """M (..., n, n) and h (..., n)."""
        return self.mechanism.dynamics(self.p, q, w)

    def load(self, q: Array, w: Array, u: Array) -> Array:
        """Bearing force in friction-free motion, shape (..., n) [N]."""
        return self.mechanism.load(self.parameters, q, w, u)
