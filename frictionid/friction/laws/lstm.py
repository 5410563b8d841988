"""A recurrent network of velocity samples: friction with a memory of any kind [Hochreiter1997].

The level is a small network of the velocity and of what the cells remember; only the level does,
so that friction never drives a joint where `dissipative` holds. A free network is bound to nothing.
"""

from dataclasses import dataclass

from frictionid.arrays import Array, namespace
from frictionid.config import Count, Positive
from frictionid.errors import InputError
from frictionid.friction import Inputs, Memory

from .layers import Hidden, input_slopes, stacked
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

    def inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        share = speed / theta[..., 1]
        if self.free:
            return share[..., None][..., :0]
        return stacked([fine(share)] + ([] if self.odd else [side_of(x.w)]))

    def read(self, theta: Array, x: Inputs) -> Array:
        share = x.w / theta[..., 1]
        if self.free:
            return stacked([within(share)])
        return stacked([within(share), side_of(x.w) * fine(namespace(x.w).abs(share))])

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        features = super().features(theta, x, memory)
        if not self.free:
            return features
        return features._replace(share=0.0 * features.share, sign=1.0 + 0.0 * x.w)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        return super().limit(theta, x, memory) * float(not self.free)

    def memory_slopes(self, theta: Array, x: Inputs, memory: Memory) -> Memory:
        """The level depends on what the cells give, not on what they hold."""
        features, out = self.features(theta, x), []
        sign = features.sign / (1 + self.odd)
        for z in self.with_cells(features.z, memory):
            y, by_z = input_slopes(self.layer_weights(theta), z, self.sizes)
            by_y = self.level_slopes(theta, y, features.share).by_y
            out += [by_y * sign * by_z[..., i - self.cells] for i in range(self.cells)]
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
