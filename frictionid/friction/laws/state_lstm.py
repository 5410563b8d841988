"""A recurrent network of all that is measured: acceleration without physics [Hochreiter1997]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import check_hidden, count, drawn, outputs
from frictionid.friction.laws.learned import FREE, check_samples, rise, stacked, weight_names
from frictionid.friction.laws.smooth_sign import check_sign
from frictionid.friction.laws.state_features import (
    BOUNDS,
    SCALES,
    START,
    UNITS,
    check_joints,
    features,
    scaled,
    width_of,
)

_KEEP = 1.0  # offset of the gates that keep what cells hold [Gers2000]


@dataclass(frozen=True)
class StateLSTM:
    """Tf = -acceleration f(q, w, u of all joints, cells), the cells reading a sample each time.

    cells : that read samples `sample_time` [s] apart; they begin empty
    hidden : tanh units between what is measured, the cells, and the acceleration
    joints, turning, width : as in `StateMLP`
    """

    joints: int = 2
    cells: int = 8
    sample_time: float = 1 / 60
    hidden: tuple[int, ...] = (32,)
    turning: bool = True
    width: float = 0.1
    odd: ClassVar[bool] = False
    uses_load: ClassVar[bool] = False
    network: ClassVar[bool] = True
    acceleration: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "hidden", check_hidden("state_lstm", self.hidden))
        check_samples("state_lstm", "cells", self.cells, self.sample_time)
        check_joints("state_lstm", self.joints, self.turning)
        check_sign("state_lstm", self.width, "tanh")

    @property
    def gate_sizes(self) -> tuple[int, int]:
        """Inputs and outputs of the gates: of input, forgetting, output, and the new content."""
        return (width_of(self.joints, self.turning) + self.cells, 4 * self.cells)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of inputs, units and outputs of the layers behind the cells."""
        return (width_of(self.joints, self.turning) + self.cells, *self.hidden, 1)

    @property
    def names(self) -> tuple[str, ...]:
        return SCALES + weight_names(self._count)

    @property
    def units(self) -> tuple[str, ...]:
        return UNITS + ("1",) * self._count

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return BOUNDS + (FREE,) * self._count

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((*START, *self._drawn(np.random.default_rng(0)).tolist()),)

    @property
    def _count(self) -> int:
        return count(self.gate_sizes) + count(self.sizes)

    def begin(self, scales: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from, of scales (..., n, 3)."""
        return scaled(scales, np.stack([self._drawn(rng) for _ in range(scales.shape[-2])]))

    def _drawn(self, rng: np.random.Generator) -> Array:
        a, b = self.gate_sizes
        gates = rng.uniform(-1.0, 1.0, (a, b)) / np.sqrt(self.cells)
        offsets = np.zeros(b)
        offsets[self.cells : 2 * self.cells] = _KEEP
        return np.concatenate([gates.ravel(), offsets, drawn(self.sizes, rng)])

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (0.0 * (x.w + theta[..., 0]),) * (2 * self.cells)

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        z = stacked([*_apart(self._features(theta, x)), *memory[: self.cells]])
        return -self.level(theta, z, 0.0 * z[..., 0])

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        xp, H = namespace(theta, x.w), self.cells
        both = stacked([*_apart(self._features(theta, x)), *memory[:H]])
        c = stacked(memory[H:])
        gates = outputs(theta[..., 3 : 3 + count(self.gate_sizes)], both, self.gate_sizes)
        take, keep, give = (rise(gates[..., k * H : (k + 1) * H]) for k in range(3))
        c = keep * c + take * xp.tanh(gates[..., 3 * H :])
        h = give * xp.tanh(c)
        return tuple(part[..., i] for part in (h, c) for i in range(H))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def seen(self, theta: Array, x: Inputs) -> tuple[Array, Array, Array, Array]:
        """What cells read (..., n, a), what is seen beside them (the same), zero, and minus one."""
        z = self._features(theta, x)
        zero = 0.0 * z[..., 0]
        return z, z, zero, zero - 1.0

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Acceleration (..., n) [rad/s^2] of inputs z: what is measured, and cells' outputs."""
        return (
            theta[..., 0] * outputs(theta[..., 3 + count(self.gate_sizes) :], z, self.sizes)[..., 0]
        )

    def _features(self, theta: Array, x: Inputs) -> Array:
        return features(theta, x, self.joints, self.turning, self.width)


def _apart(z: Array) -> list[Array]:
    return [z[..., i] for i in range(z.shape[-1])]
