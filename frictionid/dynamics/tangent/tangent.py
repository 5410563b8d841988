"""What a motion is differentiated by, and the derivatives that travel along it.

Directions, in this order, D of them:

    initial q (n), initial w (n), initial memory, free friction, base parameters, torque parameters

Friction and its memory are those of m parts, see `friction.coordinates`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.friction.coordinates import turns_of
from frictionid.mechanics import Plant

from ..state import Instant, State
from .law_derivatives import FreeTheta, LawReads


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
        """The model of some rows; friction may have one entry for each, or one for all."""
        batch = np.ndim(self.friction.theta) > 2
        friction = self.friction[rows] if batch else self.friction
        return self._replace(plant=self.plant[rows], friction=friction)

    def instant(self, state: State, u: Array) -> Instant:
        """What determines accelerations at a state under motor torques u (K, n)."""
        return Instant(self.plant, self.friction, state, u)

    @property
    def turns(self) -> Array | None:
        """Turns (c, n) of coupled parts for one of each joint; None where there are none."""
        return turns_of(self.plant.mechanism, self.plant.p)

    @property
    def directions(self) -> int:
        """Number of free friction and base parameters."""
        return self.free.directions + len(self.base)


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

    def in_parts(self, rows: Array, piece: int, parts: int) -> MotorTorque:
        """The torque of some intervals in equal parts of a piece."""
        if parts > 1 and self.finer is not None:
            return self.finer(rows, piece, parts)
        at = np.repeat(piece, parts)
        u, by = self.u[at][:, rows], self.by[at][:, :, rows]
        if parts > 1 or self.moment is None or self.moment_by is None:
            return MotorTorque(u, by)
        return MotorTorque(u, by, self.moment[at][:, rows], self.moment_by[at][:, :, rows])

    def between(self, rows: Array, first: int, last: int) -> MotorTorque:
        """The torque of some intervals in some pieces."""
        u, by, moment, moment_by = (
            None if x is None else x[first:last][..., rows, :] for x in self[:4]
        )
        return MotorTorque(u, by, moment, moment_by)  # type: ignore[arg-type]

    def as_one(self, dt: Array) -> MotorTorque:
        """The torque of all pieces of dt (K,) [s] as that of one."""
        if len(self.u) == 1:
            return self
        ahead = (np.arange(len(self.u))[::-1] + 0.5)[:, None, None] * np.square(dt)[:, None]
        u, by = self.u.mean(axis=0, keepdims=True), self.by.mean(axis=0, keepdims=True)
        moment, moment_by = ahead * (self.u - u), ahead[:, None] * (self.by - by)
        if self.moment is not None and self.moment_by is not None:
            moment, moment_by = moment + self.moment, moment_by + self.moment_by
        sums = (x.sum(axis=0, keepdims=True) for x in (moment, moment_by))
        return MotorTorque(u, by, *sums)


Advance = Callable[[Array, MotorTorque, Array, bool], Array]


def advance_in_pieces(advance: Advance, motor: MotorTorque, dt: Array, parts: int) -> None:
    """Advance intervals of length dt (K,) piece by piece, each halved where it is too long.

    advance : makes a substep of some rows under a torque of one piece, of lengths (k,) [s], and
        gives those of them, by their number, that are too long; none of which may not be halved
    parts : of a piece, at most, a power of two
    """
    every, part = np.arange(len(dt)), dt / len(motor.u)
    for piece in range(len(motor.u)):
        again = advance(every, motor.in_parts(every, piece, 1), part, parts > 1)
        if len(again):
            finer = motor.in_parts(again, piece, parts)
            _advance_in_halves(advance, again, finer, part[again] / parts)


def _advance_in_halves(advance: Advance, rows: Array, motor: MotorTorque, part: Array) -> None:
    """Advance rows (k,) by the pieces of their torque, each part (k,) [s] long, in two halves."""
    parts = len(motor.u)
    half, every = parts // 2, np.arange(len(rows))
    for first in (0, half):
        torque = motor.between(every, first, first + half)
        again = advance(rows, torque.as_one(part), half * part, half > 1)
        if len(again):
            finer = torque.between(again, 0, half)
            _advance_in_halves(advance, rows[again], finer, part[again])
