"""A network of the velocity and of its past samples: friction that remembers a window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Memory
from frictionid.laws.layers import check_hidden, count, drawn, outputs
from frictionid.laws.learned import (
    BOUNDS,
    FREE,
    HEAD,
    START,
    UNITS,
    Seen,
    check_samples,
    fine,
    level_of,
    side_of,
    stacked,
    start_of,
    weight_names,
    within,
)
from frictionid.laws.sign import check_sign, smooth_sign


@dataclass(frozen=True)
class WindowMLP:
    """Tf = level sgn(w), the level a network of w and of the newest `samples` of the velocity.

    sample_time : [s] between those samples; the memory begins as if the velocity had been constant
    hidden, odd, dissipative, monotone_tail, width, shape : as in `MLP`
    """

    samples: int = 9
    sample_time: float = 1 / 60
    hidden: tuple[int, ...] = (16, 16)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    uses_load: ClassVar[bool] = False
    network: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "hidden", check_hidden("window_mlp", self.hidden))
        check_samples("window_mlp", "samples", self.samples, self.sample_time)
        check_sign("window_mlp", self.width, self.shape)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of inputs, units and outputs of the network's layers."""
        return (1 + (not self.odd) + self.samples, *self.hidden, 1)

    @property
    def names(self) -> tuple[str, ...]:
        return HEAD + weight_names(count(self.sizes))

    @property
    def units(self) -> tuple[str, ...]:
        return UNITS + ("1",) * count(self.sizes)

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return BOUNDS + (FREE,) * count(self.sizes)

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return ((*START, *start_of(self.sizes)),)

    def begin(self, torque: Array, speed: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from, for torques and speeds (..., n) of these sizes."""
        head = np.stack([torque, speed, 0.0 * torque + START[2]], axis=-1)
        weights = np.stack([drawn(self.sizes, rng) for _ in range(torque.shape[-1])])
        shape = (*torque.shape, weights.shape[-1])
        return np.concatenate([head, np.broadcast_to(weights, shape)], axis=-1)

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (x.w + 0.0 * theta[..., 0],) * self.samples

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        seen = self.seen(theta, x, memory)
        return self.level(theta, seen.z, seen.share) * seen.sign

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        return (x.w + 0.0 * memory[0], *memory[:-1])

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self.level(theta, self._features(theta, 0.0 * x.w, side_of(x.w), memory), 0.0 * x.w)
        return namespace(level).maximum(level, 0.0 * level)

    def seen(self, theta: Array, x: Inputs, memory: Memory) -> Seen:
        """What the network sees; of theta it depends on the scales alone."""
        speed = namespace(x.w).abs(x.w)
        z = self._features(theta, speed, side_of(x.w), memory)
        return Seen(z, speed / theta[..., 1], smooth_sign(x.w, self.width, self.shape))

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Level (..., n) [N m] at what the network sees."""
        y = outputs(theta[..., 3:], z, self.sizes)[..., 0]
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def _features(self, theta: Array, speed: Array, side: Array, memory: Memory) -> Array:
        reach = theta[..., 1]
        own = [fine(speed / reach)] + ([] if self.odd else [side])
        past = [within(w / reach) for w in memory]
        return stacked([*own, *(side * w if self.odd else w for w in past)])
