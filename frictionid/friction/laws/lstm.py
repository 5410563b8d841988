"""A recurrent network of velocity samples: friction with a memory of any kind [Hochreiter1997].

The level is a small network of the velocity and of what the cells remember; only the level does,
so that friction never drives a joint where `dissipative` holds. A free network is bound to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import check_hidden, count, drawn, outputs
from frictionid.friction.laws.learned import (
    BOUNDS,
    FREE,
    HEAD,
    START,
    UNITS,
    check_samples,
    fine,
    level_of,
    rise,
    side_of,
    stacked,
    weight_names,
    within,
)
from frictionid.friction.laws.smooth_sign import check_sign, smooth_sign

_KEEP = 1.0  # offset of the gates that keep what cells hold [Gers2000]


@dataclass(frozen=True)
class LSTM:
    """Tf = level sgn(w), the level a network of w and of `cells` that read a sample each time.

    sample_time : [s] between the samples; cells begin empty
    odd : both signs of the motion are read by the same cells, and their levels averaged
    hidden : tanh units between cells and level
    dissipative, monotone_tail, width, shape : as in `MLP`
    free : friction is what the network makes of the samples alone, as in [DeMeester2020]: of any
        sign, and the same until the next sample; nothing holds a joint at rest

    Raises
    ------
    InputError
        For settings that mean nothing, or that a free network cannot keep.
    """

    cells: int = 8
    sample_time: float = 1 / 60
    hidden: tuple[int, ...] = (16,)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    free: bool = False
    uses_load: ClassVar[bool] = False
    network: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "hidden", check_hidden("lstm", self.hidden))
        check_samples("lstm", "cells", self.cells, self.sample_time)
        check_sign("lstm", self.width, self.shape)
        for name in ("odd", "dissipative", "monotone_tail"):
            if self.free and getattr(self, name):
                raise InputError(f"lstm: free = true keeps to nothing; add {name} = false")

    @property
    def gate_sizes(self) -> tuple[int, int]:
        """Inputs and outputs of the gates: of input, forgetting, output, and the new content."""
        return (1 + (not self.free) + self.cells, 4 * self.cells)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of inputs, units and outputs of the layers between cells and level."""
        beside = 0 if self.free else 1 + (not self.odd)
        return (beside + self.cells, *self.hidden, 1)

    @property
    def names(self) -> tuple[str, ...]:
        return HEAD + weight_names(self._count)

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

    def begin(self, torque: Array, speed: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from, for torques and speeds (..., n) of these sizes."""
        head = np.stack([torque, speed, 0.0 * torque + START[2]], axis=-1)
        weights = np.stack([self._drawn(rng) for _ in range(torque.shape[-1])])
        shape = (*torque.shape, weights.shape[-1])
        return np.concatenate([head, np.broadcast_to(weights, shape)], axis=-1)

    def _drawn(self, rng: np.random.Generator) -> Array:
        a, b = self.gate_sizes
        gates = rng.uniform(-1.0, 1.0, (a, b)) / np.sqrt(self.cells)
        offsets = np.zeros(b)
        offsets[self.cells : 2 * self.cells] = _KEEP
        return np.concatenate([gates.ravel(), offsets, drawn(self.sizes, rng)])

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (0.0 * (x.w + theta[..., 0]),) * (2 * self.cells * (1 + self.odd))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        speed = namespace(x.w).abs(x.w)
        return self._level(theta, speed, side_of(x.w), memory) * self._sign(x.w)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        z, half = self._read(theta, x.w), 2 * self.cells
        parts = [self._cells(theta, z, memory[:half])]
        if self.odd:
            parts.append(self._cells(theta, -z, memory[half:]))
        return tuple(part[..., i] for pair in parts for part in pair for i in range(self.cells))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        level = self._level(theta, 0.0 * x.w, side_of(x.w), memory) * (not self.free)
        return namespace(level).maximum(level, 0.0 * level)

    def seen(self, theta: Array, x: Inputs) -> tuple[Array, Array, Array, Array]:
        """What cells read (..., n, 2), what the level sees beside them, speed over reach, and sign.

        Of theta they depend on the scales alone.
        """
        share = namespace(x.w).abs(x.w) / theta[..., 1]
        own = self._own(share, side_of(x.w))
        own = stacked(own) if own else share[..., None][..., :0]
        return self._read(theta, x.w), own, share * (not self.free), self._sign(x.w)

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Level (..., n) [N m] of inputs z: speed, direction (unless odd), and cells' outputs."""
        y = outputs(theta[..., 3 + count(self.gate_sizes) :], z, self.sizes)[..., 0]
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def _level(self, theta: Array, speed: Array, side: Array, memory: Memory) -> Array:
        share = speed / theta[..., 1]
        own = self._own(share, side)
        parts = []
        for k in range(1 + self.odd):
            h = memory[2 * k * self.cells : (2 * k + 1) * self.cells]
            # the mirrored cells read -w: so each side of the motion meets both alike
            parts.append(self.level(theta, stacked([*own, *h]), share * (not self.free)))
        return sum(parts) / len(parts)

    def _sign(self, w: Array) -> Array:
        return 1.0 + 0.0 * w if self.free else smooth_sign(w, self.width, self.shape)

    def _own(self, share: Array, side: Array) -> list[Array]:
        if self.free:
            return []
        return [fine(share)] + ([] if self.odd else [side])

    def _read(self, theta: Array, w: Array) -> Array:
        share = w / theta[..., 1]
        if self.free:
            return stacked([within(share)])
        return stacked([within(share), side_of(w) * fine(namespace(w).abs(share))])

    def _cells(self, theta: Array, z: Array, memory: Memory) -> tuple[Array, Array]:
        """Outputs and contents (..., n, cells) after a sample."""
        xp, H = namespace(theta, z), self.cells
        h, c = stacked(memory[:H]), stacked(memory[H:])
        whole = 0.0 * (z[..., :1] + h[..., :1])
        both = xp.concat([z + whole, h + whole], axis=-1)
        gates = outputs(theta[..., 3 : 3 + count(self.gate_sizes)], both, self.gate_sizes)
        take, keep, give = (rise(gates[..., k * H : (k + 1) * H]) for k in range(3))
        c = keep * c + take * xp.tanh(gates[..., 3 * H :])
        return give * xp.tanh(c), c
