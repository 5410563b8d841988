"""A recurrent network of all that is measured: acceleration without physics [Hochreiter1997]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.config import Count, Positive
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import Hidden, count, drawn, outputs
from frictionid.friction.laws.lstm import cells_after, drawn_gates
from frictionid.friction.laws.network_law import (
    Features,
    NetworkLaw,
    Scale,
    stacked,
)
from frictionid.friction.laws.state_library import (
    SCALES,
    state_features,
    width_of,
)


@dataclass(frozen=True)
class StateLSTM(NetworkLaw):
    """Tf = -acceleration f(q, w, u of all joints, cells), the cells reading a sample each time.

    cells : that read samples `sample_time` [s] apart; they begin empty
    hidden : tanh units between what is measured, the cells, and the acceleration
    joints, turning, width : as in `StateMLP`
    """

    joints: Count = 2
    cells: Count = 8
    sample_time: Positive = 1 / 60
    hidden: Hidden = (32,)
    turning: bool = True
    width: float = 0.1
    shape = ""

    @property
    def gate_sizes(self) -> tuple[int, int]:
        return (width_of(self.joints, self.turning) + self.cells, 4 * self.cells)

    @property
    def sizes(self) -> tuple[int, ...]:
        return (width_of(self.joints, self.turning) + self.cells, *self.hidden, 1)

    @property
    def scales(self) -> tuple[Scale, ...]:
        return SCALES

    def drawn(self, rng: np.random.Generator) -> Array:
        return np.concatenate([drawn_gates(self.gate_sizes, rng), drawn(self.sizes, rng)])

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (0.0 * (x.w + theta[..., 0]),) * (2 * self.cells)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        of = self.features(theta, x)
        seen = [of.z[..., i] for i in range(of.z.shape[-1])]
        z = stacked([*seen, *memory[: self.cells]])
        return self.level(theta, z, of.share) * of.sign

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        z = self.features(theta, x).z
        new = cells_after(theta[..., 3 : 3 + count(self.gate_sizes)], z, memory)
        return tuple(part[..., i] for part in new for i in range(self.cells))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        z = state_features(theta, x, self.joints, self.turning, self.width)
        zero = 0.0 * z[..., 0]
        return Features(z, zero, zero - 1.0, z)

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Acceleration (..., n) [rad/s^2]."""
        y = outputs(theta[..., 3 + count(self.gate_sizes) :], z, self.sizes)[..., 0]
        return theta[..., 0] * y


@dataclass(frozen=True)
class StateMLP(NetworkLaw):
    """Tf = -acceleration f(q, w, u of all joints), f a network with `hidden` tanh units.

    joints : whose state it sees
    turning : whether the joints turn, or slide
    width : of the smooth sign of w that is one of its inputs [rad/s]
    """

    joints: Count = 2
    hidden: Hidden = (32, 32)
    turning: bool = True
    width: float = 0.1
    shape = ""  # of an input, not of friction

    @property
    def scales(self) -> tuple[Scale, ...]:
        return SCALES

    @property
    def sizes(self) -> tuple[int, ...]:
        return (width_of(self.joints, self.turning), *self.hidden, 1)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        z = state_features(theta, x, self.joints, self.turning, self.width)
        zero = 0.0 * z[..., 0]
        return Features(z, zero, zero - 1.0)

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Acceleration (..., n) [rad/s^2]."""
        return theta[..., 0] * outputs(theta[..., 3:], z, self.sizes)[..., 0]
