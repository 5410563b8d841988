"""What a motion is differentiated by, and the derivatives that travel along it.

Directions, in this order, D of them:

    initial q (n), initial w (n), initial memory, free friction, base parameters, torque parameters

Friction and its memory are those of m parts, see `friction.coordinates`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, inverse
from frictionid.dynamics.state import State
from frictionid.dynamics.tangent.law_derivatives import FreeTheta, LawReads
from frictionid.dynamics.torque_balance import less_held
from frictionid.friction import Friction
from frictionid.friction.coordinates import turns_of
from frictionid.mechanics import Plant


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
    def turns(self) -> Array | None:
        """Turns (c, n) of coupled parts for one of each joint; None where there are none."""
        return turns_of(self.plant.mechanism, self.plant.p)

    def parts_on(self, joint: int) -> list[tuple[int, float]]:
        """Parts whose friction acts on a joint, and by how much."""
        if self.turns is None:
            return [(joint, 1.0)]
        column = self.plant.mechanism.friction_map[:, joint]
        return [(int(part), float(column[part])) for part in np.flatnonzero(column)]

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
        return 2 * len(self.q) + sum(map(len, self.memory))

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
    widths = [entry.shape[-1] for entry in start.memory]
    size = 2 * n + sum(widths)
    rows = [np.zeros((size + model.directions + torques, K)) for _ in range(size)]
    for i, row in enumerate(rows):
        row[i] = 1.0
    memory = [rows[2 * n + i * m : 2 * n + (i + 1) * m] for i, m in enumerate(widths)]
    return Tangent(rows[:n], rows[n : 2 * n], memory)


def rows_of_parts(rows: list[Array], turns: Array | None) -> list[Array]:
    """Derivatives of A w, an array for each part, from those of the joints' w."""
    if turns is None:
        return rows
    return [*rows, *(sum(c * row for c, row in zip(own, rows, strict=True)) for own in turns)]


def inverse_of_free(M: Array, held: Array | None, turns: Array | None = None) -> Array:
    """Inverse of M (K, n, n) of what is free, zero in rows and columns of joints held (K, m)."""
    if held is None:
        return inverse(M)
    n = M.shape[-1]
    free = 1.0 - held[..., :n].astype(float)
    both = free[..., :, None] * free[..., None, :]
    inner = inverse(M * both + (1.0 - free)[..., None] * np.eye(n)) * both
    if turns is None or not held[..., n:].any():
        return inner
    return less_held(inner, turns, held[..., n:])


class MotorTorque(NamedTuple):
    """Motor torque of K intervals in S equal pieces, and its derivatives in E directions.

    u (S, K, n) [N m], by (S, E, K, n); moment (S, K, n) [N m s^2], that of the torque about the end
    of each piece beyond what its mean has, and moment_by (S, E, K, n). finer(rows, piece, parts):
    the torque of some intervals in parts of a piece. Without these the torque is u throughout.
    """

    u: Array
    by: Array
    moment: Array | None = None
    moment_by: Array | None = None
    finer: Callable[[Array, int, int], MotorTorque] | None = None

    def of(self, rows: Array, piece: int, parts: int) -> MotorTorque:
        """That of some intervals in equal parts of a piece."""
        if parts > 1 and self.finer is not None:
            return self.finer(rows, piece, parts)
        at = np.repeat(piece, parts)
        u, by = self.u[at][:, rows], self.by[at][:, :, rows]
        if parts > 1 or self.moment is None or self.moment_by is None:
            return MotorTorque(u, by)
        return MotorTorque(u, by, self.moment[at][:, rows], self.moment_by[at][:, :, rows])
