"""Networks of the velocity, and of its past: curves of any shape, physics held by construction.

The study learns friction by networks behind a physics step [DeMeester2020]. A window of the past,
samples of the velocity, makes friction that remembers; or of the way since these samples: bristles
bend by less than a joint moves from one to the next, but its angle is known at any time.

A recurrent network of velocity samples has a memory of any kind [Hochreiter1997]: the level is a
small network of the velocity and of what the cells remember; only the level does, so that friction
never drives a joint where `dissipative` holds. A free network is bound to nothing.

The form of the level, and what its options promise, are those of `network_law`. The mean of several
networks of one form is a law, too [Lakshminarayanan2017].
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.arrays import Array, namespace
from frictionid.config import Count, NotNegative, Positive
from frictionid.errors import InputError
from frictionid.friction import Friction, Inputs, Law, LawParameter, Memory

from .layers import Hidden, input_slopes, slopes, stacked
from .levels import above_zero
from .network_law import HEAD, REACH, Features, LevelNetwork, fine, fine_slope, side_of, within


@dataclass(frozen=True)
class MLP(LevelNetwork):
    """Tf = level sgn(w), the level a network of speed and direction with `hidden` tanh units.

    odd : the same level in both directions; else the direction is an input of the network
    dissipative : the level is positive; else friction may drive, and the break-away level is zero
        where it does
    monotone_tail : beyond the measured speeds, `reach`, the level does not fall
    others : how many other joints' velocities are inputs as well, those that come next, then from
        the first on; where a joint is at rest, its break-away level is that with others at rest
    width, shape : smoothing of sgn(w) [rad/s]

    The parameters are the scales `torque` and `reach`, the `tail`, the reach of each other joint,
    and the network's weights.
    """

    hidden: Hidden = (16, 16)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    others: Annotated[int, Field(ge=0)] = 0
    width: float = 0.02
    shape: str = "tanh"

    @property
    def scales(self) -> tuple[LawParameter, ...]:
        return HEAD + tuple(REACH._replace(name=f"reach_{i + 1}") for i in range(self.others))

    @property
    def sizes(self) -> tuple[int, ...]:
        return (1 + (not self.odd) + self.others, *self.hidden, 1)

    def initial_parameters(self, sizes: Array, rng: np.random.Generator) -> Array:
        theta = super().initial_parameters(sizes, rng)
        for i in range(self.others):
            theta[..., 3 + i] = np.roll(sizes[..., 1], -i - 1, axis=-1)
        return theta

    def gradient(self, theta: Array, x: Inputs) -> Array:
        w, xp, reach = x.w, namespace(theta, x.w), theta[..., 1]
        side, share = side_of(w), xp.abs(w) / reach
        z = self.inputs(theta, x, xp.abs(w), ())
        y, by_weights, by_z = slopes(self.layer_weights(theta), z, self.sizes)
        level = self.level_slopes(theta, y, share)
        by_share = by_z[..., 0] * fine_slope(share) + level.tail
        columns = [level.by_torque, level.by_y * (-by_share * share / reach), level.by_tail]
        for i, other in enumerate(self._others(w)):
            part = other / theta[..., 3 + i]
            inside = xp.where(xp.abs(part) < 1.0, part, 0.0 * part)
            sign = side if self.odd else 1.0
            by_part = -by_z[..., i - self.others] * sign * inside
            columns.append(level.by_y * (by_part / theta[..., 3 + i]))
        return self.torque_slopes(x, level, columns, by_weights)

    def inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        return self._inputs(theta, speed, side_of(x.w), x.w)

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        still = 0.0 * x.w
        return above_zero(self.level(theta, self._inputs(theta, still, side_of(x.w), still), still))

    def _inputs(self, theta: Array, speed: Array, side: Array, w: Array) -> Array:
        """Inputs (..., n, a) of the layers at a speed and direction, by the velocities w of all."""
        joint = [fine(speed / theta[..., 1])] + ([] if self.odd else [side])
        others = [within(o / theta[..., 3 + i]) for i, o in enumerate(self._others(w))]
        return stacked([*joint, *(side * o if self.odd else o for o in others)])

    def _others(self, w: Array) -> Iterator[Array]:
        """Velocities (..., n) of the next joint, of the one after it, and so on; 0 if none."""
        n = w.shape[-1]
        for i in range(1, self.others + 1):
            order = [(j + i) % n for j in range(n)]
            yield w[..., order] if i < n else 0.0 * w


@dataclass(frozen=True)
class WindowMLP(LevelNetwork):
    """Tf = level sgn(w), the level a network of w and of the newest `samples` of the velocity.

    sample_time : [s] between those samples; the memory begins as if the velocity had been constant
    hidden, odd, dissipative, monotone_tail, width, shape : as in `MLP`
    presliding : [rad], where positive the network reads instead how far the joint has moved since
        each of those samples, finely where that is no more than this, and the newest velocity
    """

    samples: Count = 9
    sample_time: Positive = 1 / 60
    hidden: Hidden = (16, 16)
    odd: bool = False
    dissipative: bool = True
    monotone_tail: bool = True
    width: float = 0.02
    shape: str = "tanh"
    presliding: NotNegative = 0.0
    reads_window = True

    @property
    def sizes(self) -> tuple[int, ...]:
        return (1 + (not self.odd) + self.samples + (self.presliding > 0), *self.hidden, 1)

    def start(self, theta: Array, x: Inputs) -> Memory:
        w = x.w + 0.0 * theta[..., 0]
        if not self.presliding:
            return (w,) * self.samples
        return (w, *(x.q - k * self.sample_time * w for k in range(self.samples)))

    def slopes(self, theta: Array, x: Inputs, memory: Memory) -> tuple[Array, Memory]:
        speed, reach = namespace(theta, x.w).abs(x.w), theta[..., 1]
        share, z = speed / reach, self.inputs(theta, x, speed, memory)
        y, by_weights, by_z = slopes(self.layer_weights(theta), z, self.sizes)
        level = self.level_slopes(theta, y, share)
        by_entry, by_reach = self._by_memory(x, memory, reach, by_z)
        by_reach = by_reach - (by_z[..., 0] * fine_slope(share) + level.tail) * share / reach
        columns = (level.by_torque, level.by_y * by_reach, level.by_tail)
        sign = self.sign(x.w)
        by_memory = tuple(level.by_y * sign * entry for entry in by_entry)
        return self.torque_slopes(x, level, columns, by_weights), by_memory

    def _by_memory(
        self, x: Inputs, memory: Memory, reach: Array, by_z: Array
    ) -> tuple[list[Array], Array]:
        """Derivatives (..., n) of the network's output in each entry, and in reach through them."""
        xp, side = namespace(x.w), side_of(x.w)
        by_entry, by_reach = [], 0.0 * reach
        for i, entry in enumerate(memory):
            by_input = by_z[..., i + 1 + (not self.odd)]
            if i and self.presliding:
                way = 1.0 + xp.abs(x.q - entry) / self.presliding
                by_entry.append(-by_input * side / (self.presliding * way * way))
                continue
            part = entry / reach
            rate = by_input * self._rate(part, side) / reach
            by_entry.append(rate)
            by_reach = by_reach - rate * part
        return by_entry, by_reach

    def _rate(self, part: Array, side: Array) -> Array:
        """Derivative of the input that a velocity over reach makes."""
        xp, unity = namespace(part), 1.0 + 0.0 * part
        if self.presliding:
            return side * fine_slope(xp.abs(part))
        return xp.where(xp.abs(part) < 1.0, unity, 0.0 * part) * (side if self.odd else unity)

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        newest = x.w + 0.0 * memory[0]
        if not self.presliding:
            return (newest, *memory[:-1])
        return (newest, x.q + 0.0 * newest, *memory[1:-1])

    def inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        reach, side = theta[..., 1], side_of(x.w)
        now = [fine(speed / reach)] + ([] if self.odd else [side])
        if not self.presliding:
            past = [within(w / reach) for w in memory]
            return stacked([*now, *(side * w if self.odd else w for w in past)])
        # in the direction of the motion: bristles still bent the other way drive it
        newest = side * side_of(memory[0]) * fine(namespace(x.w).abs(memory[0]) / reach)
        ways = [side * (x.q - q) / self.presliding for q in memory[1:]]
        return stacked([*now, newest, *(way / (1.0 + namespace(way).abs(way)) for way in ways)])


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


@dataclass(frozen=True)
class Ensemble(Law):
    """Tf = mean of the torques of `members` frictions of the law `base`, each with its own theta.

    width, shape : smoothing of sgn(w) of all of them [rad/s]
    """

    base: Law = MLP()
    members: Annotated[int, Field(ge=2)] = 2
    width: float = 0.02
    shape: str = "tanh"
    is_network = True

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        each = ((k, p) for k in range(self.members) for p in self.base.parameters)
        return tuple(p._replace(name=f"{p.name}.{k}") for k, p in each)

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(start) * self.members for start in self.base.initial)

    @property
    def sample_time(self) -> float | None:  # type: ignore[override]
        """The base's sample time."""
        return self.base.sample_time

    @property
    def uses_load(self) -> bool:  # type: ignore[override]
        """Whether the base does."""
        return self.base.uses_load

    def start(self, theta: Array, x: Inputs) -> Memory:
        parts = _split(theta, self.members)
        return tuple(entry for part in parts for entry in self.base.start(part, x))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        total: Any = sum(self.member.torque(part, x, z) for part, z in self._each(theta, memory))
        return total / self.members

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        parts = self._each(theta, memory)
        return tuple(entry for part, z in parts for entry in self.base.advance(part, x, z, dt))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        total: Any = sum(self.member.limit(part, x, z) for part, z in self._each(theta, memory))
        return total / self.members

    @cached_property
    def member(self) -> Law:
        """The law of each member, smoothed alike."""
        names = {f.name for f in fields(self.base)} & {"width", "shape"}
        return replace(self.base, **{name: getattr(self, name) for name in names})

    def _each(self, theta: Array, memory: Memory) -> Iterator[tuple[Array, Memory]]:
        """Parameters and memory of each member."""
        size = len(memory) // self.members
        for k, part in enumerate(_split(theta, self.members)):
            yield part, memory[k * size : (k + 1) * size]


def _split(theta: Array, members: int) -> list[Array]:
    """Parameters of each member."""
    size = theta.shape[-1] // members
    return [theta[..., k * size : (k + 1) * size] for k in range(members)]


def together(law: Any, thetas: Sequence[Array]) -> Friction:
    """Friction that is the mean of those with parameters (..., n, P); of one, that itself."""
    if len(thetas) == 1:
        return Friction(law, thetas[0])
    ensemble = Ensemble(law, len(thetas), law.width, law.shape or Ensemble.shape)
    return Friction(ensemble, namespace(*thetas).concat(list(thetas), axis=-1))
