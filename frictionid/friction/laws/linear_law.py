"""Friction as a sum of terms that are linear in the parameters: levels times sgn(w), and drags."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.smooth_sign import smooth_sign


class LinearLaw(Law):
    """Tf = (sum_i theta_i level_i) sgn(w) + sum_j theta_j drag_j, break-away at the first sum.

    `levels` and `drags` give level_i and drag_j at inputs, by the places i and j in theta.
    """

    is_linear = True

    @abstractmethod
    def levels(self, x: Inputs) -> Mapping[int, Array | float]:
        """Factor (..., n) of each parameter in the level."""

    @abstractmethod
    def drags(self, x: Inputs) -> Mapping[int, Array | float]:
        """Factor (..., n) of each parameter beside the level."""

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self.limit(theta, x, memory) * smooth_sign(x.w, self.width, self.shape)
        return sum((theta[..., i] * factor for i, factor in self.drags(x).items()), start=level)

    def gradient(self, theta: Array, x: Inputs) -> Array:
        zero = 0.0 * (theta[..., 0] + x.w)
        sign = smooth_sign(x.w, self.width, self.shape) + zero
        columns = {i: factor * sign for i, factor in self.levels(x).items()}
        columns |= {i: factor + zero for i, factor in self.drags(x).items()}
        return namespace(zero).stack([columns[i] for i in range(len(columns))], axis=-1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = sum(theta[..., i] * factor for i, factor in self.levels(x).items())
        return level + 0.0 * x.w
