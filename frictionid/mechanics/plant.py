"""A mechanism with its parameters, as the physics step needs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from frictionid.arrays import Array, namespace
from frictionid.mechanics.mechanism import Mechanism, Terms


@dataclass(frozen=True)
class Plant:
    """A mechanism with physical parameters and the base parameters p that follow from them.

    `parameters` are arrays of one batch shape (...), often one entry per recording or row; p has
    shape (..., nb). An index into a plant picks from the batch.

    >>> import numpy as np
    >>> from frictionid.mechanics import pendulum
    >>> Plant.from_parameters(pendulum(), {"mass": np.array([0.5, 1.0])})[1].p
    array([1.  , 9.81])
    """

    mechanism: Mechanism
    parameters: Mapping[str, Array]
    p: Array

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
        return Plant(
            self.mechanism, {k: v[index] for k, v in self.parameters.items()}, self.p[index]
        )

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.mechanism.n

    def terms(self, q: Array, w: Array) -> Terms:
        """Terms of the equations of motion, see `Terms`."""
        return self.mechanism.terms(self.p, q, w)

    def dynamics(self, q: Array, w: Array) -> tuple[Array, Array]:
        """M (..., n, n) and h (..., n)."""
        return self.mechanism.dynamics(self.p, q, w)

    def load(self, q: Array, w: Array, u: Array) -> Array:
        """Bearing force in friction-free motion, shape (..., n) [N]."""
        return self.mechanism.load(self.parameters, q, w, u)
