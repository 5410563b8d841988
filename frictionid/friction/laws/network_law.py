"""What laws of networks share: inputs of a known range, and a level that keeps to physics.

Tf = level sgn(w),   level = torque f(y + tail |w| / reach)

y is what a network gives, of inputs that end at the measured range: so beyond it only the tail goes
on, straight. With f(y) = log(1 + e^y) the level is positive, and friction takes energy at any speed
[Dugas2001]; a tail that is a logarithm of that kind itself never falls.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, LawParameter, Memory

from .layers import beside, cells_after, count, drawn, drawn_gates, outputs, rise
from .levels import above_zero, on_side

_FINE = 30.0  # how much finer slow speeds are resolved than fast ones: friction peaks there


# parameters before the weights, each with a value to start from
REACH = LawParameter("reach", "rad/s", 1e-3, initial=(10.0,))
HEAD = (
    LawParameter("torque", "N m", initial=(0.1,)),
    REACH,
    LawParameter("tail", "1", -math.inf, initial=(-2.0,)),
)


class Features(NamedTuple):
    """Inputs of a network, and what its level is multiplied by.

    z : (..., n, a) inputs of the layers, within the reach; those of recurrent laws without cells
    share : (..., n) speed over reach
    sign : (..., n) smooth sign of the velocity
    """

    z: Array
    share: Array
    sign: Array


class NetworkLaw(Law):
    """A law whose parameters are scales, and then the weights of a network, which training changes.

    Tf = level(theta, z, share) sign, of the `features` z, share and sign. Of theta these depend on
    the scales alone, so that training computes them once. Memory of cells is what they give, and
    then what they hold, at first nothing.

    Attributes
    ----------
    cells : int
        Number of recurrent cells, which read the motion sample by sample; 0: none.
    odd : bool
        Whether friction is the same in both directions; other cells then read -w, and the levels of
        both are averaged.
    others : int
        Number of other joints whose velocities are inputs.
    """

    is_network = True
    cells: int = 0
    odd: bool = False
    others: int = 0

    @property
    def scales(self) -> tuple[LawParameter, ...]:
        """Parameters before the weights."""
        return HEAD

    @property
    @abstractmethod
    def sizes(self) -> tuple[int, ...]:
        """Numbers of inputs, units and outputs of the network's layers."""

    @property
    def gate_sizes(self) -> tuple[int, int]:
        """Inputs and outputs of the cells' gates: of input, forgetting, output, and new content."""
        return (0, 0)

    @abstractmethod
    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        """Inputs of the network; recurrent laws need no memory here."""

    @abstractmethod
    def level(self, theta: Array, z: Array, share: Array) -> Array:
        """Level (..., n) [N m] of inputs z of the layers, the cells' outputs last."""

    def read(self, theta: Array, x: Inputs) -> Array | None:
        """What the cells read, (..., n, b); None of laws without."""
        return None

    def start(self, theta: Array, x: Inputs) -> Memory:
        return (0.0 * (x.w + theta[..., 0]),) * (2 * self.cells * (1 + self.odd))

    def advance(self, theta: Array, x: Inputs, memory: Memory, dt: Array) -> Memory:
        read, first, size = self.read(theta, x), len(self.scales), 2 * self.cells
        if read is None:
            return memory
        gates = theta[..., first : first + count(self.gate_sizes)]
        parts = [cells_after(gates, read, memory[:size])]
        if self.odd:
            parts.append(cells_after(gates, -read, memory[size:]))
        return tuple(part[..., i] for pair in parts for part in pair for i in range(self.cells))

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        features = self.features(theta, x, memory)
        return self.mean_level(theta, features.z, features.share, memory) * features.sign

    def mean_level(self, theta: Array, z: Array, share: Array, memory: Memory) -> Array:
        """Level (..., n) [N m] of inputs z of the layers without cells, and of what cells give."""
        levels = [self.level(theta, each, share) for each in self.with_cells(z, memory)]
        return sum(levels[1:], start=levels[0]) / len(levels)

    def with_cells(self, z: Array, memory: Memory) -> list[Array]:
        """Inputs z of the layers with the outputs of the cells; of odd laws those of both halves.

        The mirrored cells read -w: so each side of the motion meets both alike.
        """
        if not self.cells:
            return [z]
        first = range(0, len(memory), 2 * self.cells)
        outputs = (memory[k : k + self.cells] for k in first)
        return [beside(z, namespace(z).stack(h, axis=-1)) for h in outputs]

    @property
    def weights(self) -> int:
        """Number of weights of one joint."""
        return count(self.gate_sizes) + count(self.sizes)

    def drawn(self, rng: np.random.Generator) -> Array:
        """Weights (weights,) of one joint to learn from."""
        layers = (drawn_gates(self.gate_sizes, rng),) if self.cells else ()
        return np.concatenate([*layers, drawn(self.sizes, rng)])

    def layer_weights(self, theta: Array) -> Array:
        """Weights of the layers, which stand last in theta."""
        return theta[..., len(self.scales) + count(self.gate_sizes) :]

    @cached_property
    def parameters(self) -> tuple[LawParameter, ...]:
        return self.scales + _weights(self.weights)

    @cached_property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        starts = (scale.initial[0] for scale in self.scales)
        return ((*starts, *self.drawn(np.random.default_rng(0)).tolist()),)

    def initial_parameters(self, sizes: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from; `sizes` (..., n, k) are the first k scales."""
        others = [scale.initial[0] for scale in self.scales[sizes.shape[-1] :]]
        weights = np.stack([self.drawn(rng) for _ in range(sizes.shape[-2])])
        rest = np.concatenate([np.broadcast_to(others, (len(weights), len(others))), weights], -1)
        shape = (*sizes.shape[:-1], rest.shape[-1])
        return np.concatenate([sizes, np.broadcast_to(rest, shape)], axis=-1)


def is_learned(law: Law) -> Array:
    """Which of a law's parameters (P,) training changes: those that are no scales."""
    return np.array([unit == "1" for unit in law.units])


@cache
def _weights(count: int) -> tuple[LawParameter, ...]:
    """A network's weights as parameters."""
    return tuple(LawParameter(f"w{i}", "1", -math.inf) for i in range(count))


def softplus(y: Array) -> Array:
    """log(1 + e^y): positive, and y itself where that is large.

    >>> softplus(np.array([-1e3, 0.0, 9.0])).round(3)
    array([0.   , 0.693, 9.   ])
    """
    return namespace(y).logaddexp(y, 0.0 * y)


def side_of(w: Array) -> Array:
    """1 where w > 0, else -1.

    >>> side_of(np.array([-2.0, 0.0, 2.0]))
    array([-1., -1.,  1.])
    """
    unity = 1.0 + 0.0 * w
    return on_side(w, unity, -unity)


def fine(share: Array) -> Array:
    """Speeds from 0 to 1 so that slow ones are further apart; constant beyond 1.

    >>> fine(np.array([0.0, 0.1, 1.0, 2.0])).round(3)
    array([0.   , 0.404, 1.   , 1.   ])
    """
    xp = namespace(share)
    return xp.log1p(_FINE * xp.minimum(share, 0.0 * share + 1.0)) / math.log1p(_FINE)


def fine_slope(share: Array) -> Array:
    """Slope of `fine`."""
    inside = namespace(share).where(share < 1.0, 1.0 + 0.0 * share, 0.0 * share)
    return inside * _FINE / ((1.0 + _FINE * share) * math.log1p(_FINE))


def within(share: Array) -> Array:
    """Velocities over their range, no further than it goes.

    >>> within(np.array([-3.0, 0.5, 3.0]))
    array([-1. ,  0.5,  1. ])
    """
    xp, unity = namespace(share), 0.0 * share + 1.0
    return xp.minimum(xp.maximum(share, -unity), unity)


class LevelSlopes(NamedTuple):
    """Derivatives (..., n) of a level: in the scale `torque`, in a network's outputs y, in `tail`.

    tail : (..., n), slope of y + tail share in share
    """

    by_torque: Array
    by_y: Array
    by_tail: Array
    tail: Array


class LevelNetwork(NetworkLaw):
    """A network whose outputs y make a level, torque f(y + tail share).

    dissipative : the level is positive, f(y) = log(1 + e^y); otherwise f(y) = y
    monotone_tail : beyond the measured speeds the level does not fall
    """

    dissipative: bool
    monotone_tail: bool

    def network(self, theta: Array, z: Array) -> Array:
        """Outputs (..., n) of the layers."""
        return outputs(self.layer_weights(theta), z, self.sizes)[..., 0]

    def level(self, theta: Array, z: Array, share: Array) -> Array:
        tail, y = theta[..., 2], self.network(theta, z)
        y = y + (softplus(tail) if self.monotone_tail else tail) * share
        return theta[..., 0] * (softplus(y) if self.dissipative else y)

    def level_slopes(self, theta: Array, y: Array, share: Array) -> LevelSlopes:
        """Derivatives of the level where the layers' outputs are y."""
        tail = softplus(theta[..., 2]) if self.monotone_tail else theta[..., 2]
        y = y + tail * share
        by_y = theta[..., 0] * (rise(y) if self.dissipative else 1.0 + 0.0 * y)
        by_tail = by_y * (share * (rise(theta[..., 2]) if self.monotone_tail else 1.0))
        return LevelSlopes(softplus(y) if self.dissipative else y, by_y, by_tail, tail)

    def torque_slopes(
        self, x: Inputs, level: LevelSlopes, by_scales: Sequence[Array], by_weights: Array
    ) -> Array:
        """Derivatives (..., n, P) of the torque, from those of the level and of the outputs."""
        xp = namespace(by_weights)
        head = xp.stack([column + 0.0 * level.by_y for column in by_scales], axis=-1)
        whole = xp.concat([head, level.by_y[..., None] * by_weights], axis=-1)
        return whole * self.sign(x.w)[..., None]

    @abstractmethod
    def inputs(self, theta: Array, x: Inputs, speed: Array, memory: Memory) -> Array:
        """Inputs (..., n, a) of the layers at another speed in the direction of x.w."""

    def features(self, theta: Array, x: Inputs, memory: Memory = ()) -> Features:
        speed = namespace(x.w).abs(x.w)
        z = self.inputs(theta, x, speed, memory)
        return Features(z, speed / theta[..., 1], self.sign(x.w))

    def limit(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        still = 0.0 * x.w
        z = self.inputs(theta, x, still, memory)
        return above_zero(self.mean_level(theta, z, still, memory))
