"""A recurrent network of velocity samples: friction with a memory of any kind [Hochreiter1997].

The level is a small network of the velocity and of what the cells remember; only the level does,
so that friction never drives a joint where `dissipative` holds. A free network is bound to nothing.
"""

from dataclasses import dataclass
from typing import Any

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Memory

from ..law import smooth_sign
from .layers import Hidden, cells_after, count, input_slopes, stacked
from .levels import above_zero
from .mlp import MLP
from .network_law import Features, LevelNetwork, fine, side_of, within


@dataclass(frozen=True)
class LSTM(LevelNetwork):
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
        now = self._now(share, side_of(x.w))
        z = stacked(now) if now else share[..., None][..., :0]
        return Features(z, share * float(not self.free), self._sign(x.w), self._read(theta, x.w))

    def memory_slopes(self, theta: Array, x: Inputs, memory: Memory) -> Memory:
        """The level depends on what the cells give, not on what they hold."""
        share = namespace(x.w).abs(x.w) / theta[..., 1]
        now = self._now(share, side_of(x.w))
        share = share * float(not self.free)
        sign = self._sign(x.w) / (1 + self.odd)
        out = []
        for k in range(1 + self.odd):
            h = memory[2 * k * self.cells : (2 * k + 1) * self.cells]
            z = stacked([*now, *h])
            y, by_z = input_slopes(self.layer_weights(theta), z, self.sizes)
            by_y = self.level_slopes(theta, y, share).by_y
            out += [by_y * sign * by_z[..., len(now) + i] for i in range(self.cells)]
            out += [0.0 * y] * self.cells
        return tuple(out)

    def while_held(self, theta: Array, memory: Memory) -> tuple[MLP, Array] | None:
        """What the cells give only shifts the offsets of the first units."""
        if self.free or self.odd:
            return None
        xp, h = namespace(theta, memory[0]), stacked(memory[: self.cells])
        row, units = self.layer_weights(theta), self.hidden[0]
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

    def _level(self, theta: Array, speed: Array, side: Array, memory: Memory) -> Array:
        share = speed / theta[..., 1]
        now = self._now(share, side)
        parts = []
        for k in range(1 + self.odd):
            h = memory[2 * k * self.cells : (2 * k + 1) * self.cells]
            # the mirrored cells read -w: so each side of the motion meets both alike
            parts.append(self.level(theta, stacked([*now, *h]), share * float(not self.free)))
        total: Any = sum(parts)
        return total / len(parts)

    def _sign(self, w: Array) -> Array:
        return 1.0 + 0.0 * w if self.free else smooth_sign(w, self.width, self.shape)

    def _now(self, share: Array, side: Array) -> list[Array]:
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
