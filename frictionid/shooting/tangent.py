"""What a motion is differentiated by, and the derivatives that travel along it.

Directions, in this order, D of them:

    initial q (n), initial w (n), initial memory, free friction, base parameters, torque parameters
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse
from frictionid.dynamics.state import State
from frictionid.friction import Friction
from frictionid.mechanics import Plant
from frictionid.shooting.law_derivatives import FreeTheta, LawReads


class MotionModel(NamedTuple):
    """Plant (p for each of K intervals) and friction, and what of them is free.

    free : entries of theta; base : places of the free base parameters
    reads : what the law reads besides a joint's velocity
    """

    plant: Plant
    friction: Friction
    free: FreeTheta
    base: tuple[int, ...]
    reads: LawReads

    def take(self, rows: Array) -> MotionModel:
        """That of some rows; friction may have one entry for each, or one for all."""
        batch = np.ndim(self.friction.theta) > 2
        friction = self.friction[rows] if batch else self.friction
        return self._replace(plant=self.plant[rows], friction=friction)

    @property
    def directions(self) -> int:
        """Number of free friction and base parameters."""
        return len(self.free.joint) + len(self.base)


class Tangent(NamedTuple):
    """Derivatives of K motions: of q and w (D, K) for each joint, of each memory entry likewise.

    They change in place, substep by substep.
    """

    q: list[Array]
    w: list[Array]
    memory: list[list[Array]]

    @property
    def theta(self) -> int:
        """Place of the first friction parameter among the directions."""
        return len(self.q) * (2 + len(self.memory))

    def rows(self) -> list[Array]:
        """All derivatives, in the order of the state: q, w, memory."""
        return [*self.q, *self.w, *(row for entry in self.memory for row in entry)]

    def take(self, rows: Array) -> Tangent:
        """Copies of those of some motions."""
        return Tangent(
            [x[:, rows] for x in self.q],
            [x[:, rows] for x in self.w],
            [[x[:, rows] for x in entry] for entry in self.memory],
        )

    def put(self, rows: Array, own: Tangent) -> None:
        """Replace those of some motions, in place."""
        for whole, part in zip(self.rows(), own.rows(), strict=True):
            whole[:, rows] = part


def initial_tangent(model: MotionModel, start: State, torques: int) -> Tangent:
    """Derivatives of states (K, n) by themselves, with so many torque parameters."""
    K, n = start.q.shape
    size = n * (2 + len(start.memory))
    rows = [np.zeros((size + model.directions + torques, K)) for _ in range(size)]
    for i, row in enumerate(rows):
        row[i] = 1.0
    memory = [rows[(2 + i) * n : (3 + i) * n] for i in range(len(start.memory))]
    return Tangent(rows[:n], rows[n : 2 * n], memory)


def inverse_of_free(M: Array, held: Array | None) -> Array:
    """Inverse of M of the joints that are free, zero in rows and columns of those held."""
    if held is None:
        return inverse(M)
    free = 1.0 - held.astype(float)
    both = free[..., :, None] * free[..., None, :]
    return inverse(M * both + (1.0 - free)[..., None] * np.eye(M.shape[-1])) * both
