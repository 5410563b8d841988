"""A recurrent network of velocity samples: friction with a memory of any kind [Hochreiter1997].

The level is a small network of the velocity and of what the cells remember; only the level does,
so that friction never drives a joint where `dissipative` holds. A free network is bound to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Memory
from frictionid.friction.laws.layers import Hidden, count, drawn, input_slopes, outputs
from frictionid.friction.laws.levels import above_zero
from frictionid.friction.laws.mlp import MLP
from frictionid.friction.laws.network_law import (
    Features,
    NetworkLaw,
    fine,
    level_of,
    level_slopes,
    rise,
    side_of,
    stacked,
    within,
)
from frictionid.friction.smooth_sign import smooth_sign

_KEEP = 1.0  # offset of the gates that keep what cells hold [Gers2000]


@dataclass(frozen=True)
class LSTM(NetworkLaw):
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

    cells: Count = 8
    sample_time: Positive = 1 / 60
    hidden: Hidden = (16,)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    free: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("odd", "dissipative", "monotone_tail"):
            if self.free and getattr(self, name):
                raise InputError(
                    f"lstm: free = true cannot be combined with {name}: add {name} = false"
                )

    @property
    def gate_sizes(self) -> tuple[int, int]:
        return (1 + (not self.free) + self.cells, 4 * self.cells)

    @property
    def sizes(self) -> tuple[int, ...]:
        beside = 0 if self.free else 1 + (not self.odd)
        return (beside + self.cells, *self.hidden, 1)

    def drawn(self, rng: np.random.Generator) -> Array:
        return np.concatenate([drawn_gates(self.gate_sizes, rng), drawn(self.sizes, rng)])

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
        return above_zero(
            self._level(theta, 0.0 * x.w, side_of(x.w), memory) * float(not self.free)
        )

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        share = namespace(x.w).abs(x.w) / theta[..., 1]
        own = self._own(share, side_of(x.w))
        z = stacked(own) if own else share[..., None][..., :0]
        return Features(z, share * float(not self.free), self._sign(x.w), self._read(theta, x.w))

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        y = outputs(self._layer_weights(theta), z, self.sizes)[..., 0]
        return level_of(theta, y, share, self.dissipative, self.monotone_tail)

    def memory_slopes(self, theta: Array, x: Inputs, memory: Memory) -> Memory:
        """The level depends on what the cells give, not on what they hold."""
        share = namespace(x.w).abs(x.w) / theta[..., 1]
        own = self._own(share, side_of(x.w))
        share = share * float(not self.free)
        sign = self._sign(x.w) / (1 + self.odd)
        out = []
        for k in range(1 + self.odd):
            h = memory[2 * k * self.cells : (2 * k + 1) * self.cells]
            y, by_z = input_slopes(self._layer_weights(theta), stacked([*own, *h]), self.sizes)
            of = level_slopes(theta, y, share, self.dissipative, self.monotone_tail)
            out += [of.by_y * sign * by_z[..., len(own) + i] for i in range(self.cells)]
            out += [0.0 * y] * self.cells
        return tuple(out)

    def while_held(self, theta: Array, memory: Memory) -> tuple[MLP, Array] | None:
        """What the cells give only shifts the offsets of the first units."""
        if self.free or self.odd:
            return None
        xp, h = namespace(theta, memory[0]), stacked(memory[: self.cells])
        row, units = self._layer_weights(theta), self.hidden[0]
        first = [self.sizes[0] * units, (self.sizes[0] - self.cells) * units]
        W = xp.reshape(row[..., first[1] : first[0]], (*row.shape[:-1], self.cells, units))
        shift = xp.matmul(h[..., None, :], W)[..., 0, :]
        offsets = row[..., first[0] : first[0] + units] + shift
        parts = theta[..., :3], row[..., : first[1]], offsets, row[..., first[0] + units :]
        whole = [xp.broadcast_to(p, (*shift.shape[:-1], p.shape[-1])) for p in parts]
        law = MLP(
            hidden=self.hidden,
            dissipative=self.dissipative,
            monotone_tail=self.monotone_tail,
            width=self.width,
            shape=self.shape,
        )
        return law, xp.concat(whole, axis=-1)

    def _layer_weights(self, theta: Array) -> Array:
        return theta[..., 3 + count(self.gate_sizes) :]

    def _level(self, theta: Array, speed: Array, side: Array, memory: Memory) -> Array:
        share = speed / theta[..., 1]
        own = self._own(share, side)
        parts = []
        for k in range(1 + self.odd):
            h = memory[2 * k * self.cells : (2 * k + 1) * self.cells]
            # the mirrored cells read -w: so each side of the motion meets both alike
            parts.append(self.level(theta, stacked([*own, *h]), share * float(not self.free)))
        total: Any = sum(parts)
        return total / len(parts)

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
        return cells_after(theta[..., 3 : 3 + count(self.gate_sizes)], z, memory)


def drawn_gates(sizes: tuple[int, int], rng: np.random.Generator) -> Array:
    """Weights to learn from of gates with these numbers of inputs and outputs."""
    cells = sizes[1] // 4
    gates = rng.uniform(-1.0, 1.0, sizes) / np.sqrt(cells)
    offsets = np.zeros(sizes[1])
    offsets[cells : 2 * cells] = _KEEP
    return np.concatenate([gates.ravel(), offsets])


def cells_after(weights: Array, z: Array, memory: Memory) -> tuple[Array, Array]:
    """Outputs h and contents c (..., n, H) of cells after a sample z (..., n, a).

    c' = keep c + take tanh(new),   h' = give tanh(c')

    of the gates take, keep, give and new, linear in z and h; `memory` holds h and then c.
    """
    xp, H = namespace(weights, z), len(memory) // 2
    h, c = stacked(memory[:H]), stacked(memory[H:])
    whole = 0.0 * (z[..., :1] + h[..., :1])
    both = xp.concat([z + whole, h + whole], axis=-1)
    gates = outputs(weights, both, (both.shape[-1], 4 * H))
    take, keep, give = (rise(gates[..., k * H : (k + 1) * H]) for k in range(3))
    c = keep * c + take * xp.tanh(gates[..., 3 * H :])
    return give * xp.tanh(c), c
