"""A network of all that is measured: acceleration without physics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import check_hidden, count, drawn, outputs
from frictionid.friction.laws.learned import FREE, Seen, start_of, weight_names
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


@dataclass(frozen=True)
class StateMLP:
    """Tf = -acceleration f(q, w, u of all joints), f a network with `hidden` tanh units.

    joints : whose state it sees
    turning : whether the joints turn, or slide
    width : of the smooth sign of w that is one of its inputs [rad/s]
    """

    joints: int = 2
    hidden: tuple[int, ...] = (32, 32)
    turning: bool = True
    width: float = 0.1
    sample_time: ClassVar[float | None] = None
    uses_load: ClassVar[bool] = False
    network: ClassVar[bool] = True
    acceleration: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "hidden", check_hidden("state_mlp", self.hidden))
        check_joints("state_mlp", self.joints, self.turning)
        check_sign("state_mlp", self.width, "tanh")

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of inputs, units and outputs of the network's layers."""
        return (width_of(self.joints, self.turning), *self.hidden, 1)

    @property
    def names(self) -> tuple[str, ...]:
        return SCALES + weight_names(count(self.sizes))

    @property
    def units(self) -> tuple[str, ...]:
        return UNITS + ("1",) * count(self.sizes)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return BOUNDS + (FREE,) * count(self.sizes)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((*START, *start_of(self.sizes)),)

    def begin(self, scales: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from, of scales (..., n, 3)."""
        return scaled(scales, np.stack([drawn(self.sizes, rng) for _ in range(scales.shape[-2])]))

    def start(self, theta: Array, x: Inputs) -> Memory:
        return ()

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        z = features(theta, x, self.joints, self.turning, self.width)
        return -self.level(theta, z, 0.0 * z[..., 0])

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return memory

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return 0.0 * (theta[..., 0] + x.w)

    def seen(self, theta: Array, x: Inputs, memory: Memory) -> Seen:
        """What the network sees; of theta it depends on the scales alone."""
        z = features(theta, x, self.joints, self.turning, self.width)
        zero = 0.0 * z[..., 0]
        return Seen(z, zero, zero - 1.0)

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Acceleration (..., n) [rad/s^2] at what the network sees."""
        return theta[..., 0] * outputs(theta[..., 3:], z, self.sizes)[..., 0]
