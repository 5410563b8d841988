"""What laws of networks share: inputs of a known range, and a level that keeps to physics.

Tf = level sgn(w),   level = torque f(y + tail |w| / reach)

y is what a network gives, of inputs that end at the measured range: so beyond it only the tail goes
on, straight. With f(y) = log(1 + e^y) the level is positive, and friction takes energy at any speed
[Dugas2001]; a tail that is a logarithm of that kind itself never falls.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.friction import Inputs, Law, Memory
from frictionid.friction.laws.layers import count, drawn
from frictionid.friction.laws.levels import LEVEL, Range, on_side

FREE: Range = (-float("inf"), float("inf"))
SPEED: Range = (1e-3, float("inf"))
_FINE = 30.0  # how much finer slow speeds are resolved than fast ones: friction peaks there


class Scale(NamedTuple):
    """A parameter before the weights: its name, unit and bounds, and a value to start from."""

    name: str
    unit: str
    bounds: Range
    start: float


HEAD = (
    Scale("torque", "N m", LEVEL, 0.1),
    Scale("reach", "rad/s", SPEED, 10.0),
    Scale("tail", "1", FREE, -2.0),
)


class Features(NamedTuple):
    """Inputs of a network, and what its level is multiplied by.

    z : (..., n, a) inputs of the layers, within the reach; those of recurrent laws without cells
    share : (..., n) speed over reach
    sign : (..., n) smooth sign of the velocity
    read : (..., n, b) what the cells of recurrent laws read
    """

    z: Array
    share: Array
    sign: Array
    read: Array | None = None


class NetworkLaw(Law):
    """A law whose parameters are scales, and then the weights of a network, which training changes.

    Tf = level(theta, z, share) sign, of the `features` z, share and sign. Of theta these depend on
    the scales alone, so that training computes them once.

    Attributes
    ----------
    cells : int
        Number of recurrent cells, which read the motion sample by sample; 0: none.
    odd : bool
        Whether friction is the same in both directions; cells then read -w as well.
    samples : int
        Number of past samples in the memory of a law that reads a window of them.
    presliding : float
        Scale [rad] of angles in that window; 0: it holds velocities.
    others : int
        Number of other joints whose velocities are inputs.
    """

    is_network = True
    cells: int = 0
    odd: bool = False
    samples: int = 0
    presliding: float = 0.0
    others: int = 0

    @property
    def scales(self) -> tuple[Scale, ...]:
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

    def torque(self, theta: Array, x: Inputs, memory: Memory) -> Array:
        of = self.features(theta, x, memory)
        return self.level(theta, of.z, of.share) * of.sign

    @property
    def weights(self) -> int:
        """Number of weights of one joint."""
        return count(self.gate_sizes) + count(self.sizes)

    def drawn(self, rng: np.random.Generator) -> Array:
        """Weights (weights,) of one joint to learn from."""
        return drawn(self.sizes, rng)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(scale.name for scale in self.scales) + weight_names(self.weights)

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(scale.unit for scale in self.scales) + ("1",) * self.weights

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        return tuple(scale.bounds for scale in self.scales) + (FREE,) * self.weights

    @property
    def initial(self) -> tuple[tuple[float, ...], ...]:
        starts = tuple(scale.start for scale in self.scales)
        return ((*starts, *self.drawn(np.random.default_rng(0)).tolist()),)

    def initial_parameters(self, sizes: Array, rng: np.random.Generator) -> Array:
        """Parameters (..., n, P) to learn from; `sizes` (..., n, k) are the first k scales."""
        others = [scale.start for scale in self.scales[sizes.shape[-1] :]]
        weights = np.stack([self.drawn(rng) for _ in range(sizes.shape[-2])])
        rest = np.concatenate([np.broadcast_to(others, (len(weights), len(others))), weights], -1)
        shape = (*sizes.shape[:-1], rest.shape[-1])
        return np.concatenate([sizes, np.broadcast_to(rest, shape)], axis=-1)


def is_learned(law: Law) -> Array:
    """Which of a law's parameters (P,) training changes: those that are no scales."""
    return np.array([unit == "1" for unit in law.units])


@cache
def weight_names(count: int) -> tuple[str, ...]:
    """Names of a network's weights."""
    return tuple(f"w{i}" for i in range(count))


def softplus(y: Array) -> Array:
    """log(1 + e^y): positive, and y itself where that is large.

    >>> softplus(np.array([-1e3, 0.0, 9.0])).round(3)
    array([0.   , 0.693, 9.   ])
    """
    return namespace(y).logaddexp(y, 0.0 * y)


def rise(y: Array) -> Array:
    """Slope of `softplus`: between zero and one.

    >>> rise(np.array([-1e3, 0.0, 1e3]))
    array([0. , 0.5, 1. ])
    """
    return 0.5 + 0.5 * namespace(y).tanh(0.5 * y)


def side_of(w: Array) -> Array:
    """1 where w > 0, else -1.

    >>> side_of(np.array([-2.0, 0.0, 2.0]))
    array([-1., -1.,  1.])
    """
    one = 1.0 + 0.0 * w
    return on_side(w, one, -one)


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
    xp, one = namespace(share), 0.0 * share + 1.0
    return xp.minimum(xp.maximum(share, -one), one)


def stacked(features: Sequence[Array]) -> Array:
    """Features (..., n, a) of arrays whose batch axes broadcast."""
    whole: Any = sum(0.0 * feature for feature in features)
    return namespace(whole).stack([feature + whole for feature in features], axis=-1)


class LevelSlopes(NamedTuple):
    """Derivatives (..., n) of a level: in the scale `torque`, in a network's outputs y, in `tail`.

    tail : (..., n), slope of y + tail share in share
    """

    by_torque: Array
    by_y: Array
    by_tail: Array
    tail: Array


def level_slopes(
    theta: Array, y: Array, share: Array, dissipative: bool, monotone: bool
) -> LevelSlopes:
    """Derivatives of `level_of`."""
    tail = softplus(theta[..., 2]) if monotone else theta[..., 2]
    y = y + tail * share
    by_y = theta[..., 0] * (rise(y) if dissipative else 1.0 + 0.0 * y)
    by_tail = by_y * (share * (rise(theta[..., 2]) if monotone else 1.0))
    return LevelSlopes(softplus(y) if dissipative else y, by_y, by_tail, tail)


def level_of(theta: Array, y: Array, share: Array, dissipative: bool, monotone: bool) -> Array:
    """Level (..., n) [N m] of a network's outputs y at speeds over reach."""
    tail = theta[..., 2]
    y = y + (softplus(tail) if monotone else tail) * share
    return theta[..., 0] * (softplus(y) if dissipative else y)
