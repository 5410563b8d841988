"""The block of a network's numbers: the few combinations of them that the motion sees.

A motion sees a network through its torque alone, which few combinations of its numbers change by
more than rounding: those of the largest singular values. A network answers to its numbers far from
linearly, but the motion nearly so to the torque. So a step of the combinations is taken as one of
the torques, which the network's numbers then follow, and the combinations are found anew where they
have got.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.shooting.combined import Combined
from frictionid.shooting.parameters.parameter_block import Entry, Guess
from frictionid.shooting.torque_samples import Points

_TURNS = 12  # of Gauss and Newton towards wanted torques
_RIDGE = (1e-4, 10.0)  # of the largest singular value, and its growth after a step too far


@dataclass(frozen=True, eq=False)
class Combinations:
    """Combinations of a network's numbers, in units of how far the prior lets them move.

    begin : (n, P), the numbers there; points : of the motion, where the combinations show
    free : (P,), numbers that may move
    reach : standard deviation of the prior, of the size of all the numbers
    count : of the combinations of a joint
    """

    begin: Array
    points: Points
    free: Array
    reach: float
    count: int
    name: str = "friction"
    enters: str = "friction"

    def of(self, friction: Friction, before: Array | None = None) -> Friction:
        """The friction as one of the combinations, all zero, that the points show best.

        before : (n, P, r), directions that are to stay what they were, nearly
        """
        law, theta = friction.law, friction.theta
        slopes = self.points.slopes(friction) * self.free
        directions = np.zeros((*theta.shape, self.count))
        for j in range(friction.n):
            _, _, right = np.linalg.svd(slopes[:, j], full_matrices=False)
            own = self._scale[j] * right[: self.count].T
            if before is not None:
                left, _, right = np.linalg.svd(own.T @ before[j])
                own = own @ (left @ right)
            directions[j] = own
        few = Combined(law, law.width, law.shape, theta, directions)
        return replace(friction, law=few, theta=np.zeros((friction.n, self.count)))

    @property
    def _scale(self) -> Array:
        """Length (n,) of the directions."""
        return np.asarray(self.reach * np.sqrt((self.begin[:, self.free] ** 2).mean(axis=-1)))

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        friction, joints = guess.friction, guess.mechanism.description.joints
        value = self._values(friction)
        return tuple(
            Entry(
                block=self.name,
                name=f"{friction.law.names[k]} of {joint}",
                unit=friction.units[k],
                value=float(value[j, k]),
                prior=1.0,
                place=(j, k),
            )
            for j, joint in enumerate(joints)
            for k in range(self.count)
        )

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        law: Any = guess.friction.law  # of `of`: Combined
        step = -self._values(guess.friction)
        for entry, value in zip(entries, values, strict=True):
            step[entry.place] += value
        here = replace(guess.friction, law=law.law, theta=law.origin)
        change = (law.directions @ step[..., None])[..., 0]
        turn = (self.points.slopes(here) * change).sum(axis=-1)
        moved = self._moved(here, change, self.points.torque(here) + turn)
        return guess._replace(friction=self.of(moved, law.directions))

    def _values(self, friction: Friction) -> Array:
        """How far (n, r) the numbers are from where they began."""
        law: Any = friction.law
        directions, off = law.directions, law.numbers(friction.theta) - self.begin
        return np.einsum("np,npr->nr", off, directions) / self._scale[:, None] ** 2

    def _moved(self, friction: Friction, change: Array, wanted: Array) -> Friction:
        """The friction with numbers changed so that they give wanted torques (N, n), nearly.

        By damped steps of Gauss and Newton, the first of them as given, (n, P).
        """
        theta, (ridge, more) = friction.theta, _RIDGE
        off = wanted - self.points.torque(friction)
        damping = np.full(friction.n, ridge)
        for _ in range(_TURNS):
            trial = theta + change
            left = wanted - self.points.torque(replace(friction, theta=trial))
            better = (left**2).sum(axis=0) < (off**2).sum(axis=0)
            theta = np.where(better[:, None], trial, theta)
            off = np.where(better, left, off)
            damping = np.where(better, damping / more, damping * more)
            slopes = self.points.slopes(replace(friction, theta=theta)) * self.free
            parts = [_solved(slopes[:, j], off[:, j], damping[j]) for j in range(friction.n)]
            change = np.stack(parts)
        return replace(friction, theta=theta)


def _solved(slopes: Array, off: Array, damping: float) -> Array:
    """Change (P,) of numbers with slopes (N, P) that takes off (N,) away, damped."""
    left, size, right = np.linalg.svd(slopes, full_matrices=False)
    return np.asarray(right.T @ (size / (size**2 + (damping * size[0]) ** 2) * (left.T @ off)))
