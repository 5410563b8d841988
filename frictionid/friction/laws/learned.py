"""What laws of networks share: inputs of a known range, and a level that keeps to physics.

Tf = level sgn(w),   level = torque f(y + tail |w| / reach)

y is what a network gives, of inputs that end at the measured range: so beyond it only the tail goes
on, straight. With f(y) = log(1 + e^y) the level is positive, and friction takes energy at any speed
[Dugas2001]; a tail that is a logarithm of that kind itself never falls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, namespace
from frictionid.errors import InputError
from frictionid.friction import Law
from frictionid.friction.laws.layers import drawn
from frictionid.friction.laws.levels import LEVEL, Range, by_direction

HEAD = ("torque", "reach", "tail")  # how the parameters begin: scales of torque, of speed, and tail
UNITS = ("N m", "rad/s", "1")
FREE: Range = (-float("inf"), float("inf"))
SPEED: Range = (1e-3, float("inf"))
BOUNDS = (LEVEL, SPEED, FREE)
START = (0.1, 10.0, -2.0)
_FINE = 30.0  # how much finer slow speeds are told apart than fast ones: friction dips there


def is_learned(law: Law) -> Array:
    """Which of a law's parameters (P,) training changes: those that are no scales."""
    return np.array([unit == "1" for unit in law.units])


def check_samples(law: str, name: str, count: Any, sample_time: Any) -> None:
    """Refuse memories of no length, and samples at no distance.

    Raises
    ------
    InputError
        Naming the law, the setting and its value.
    """
    if type(count) is not int or count < 1:
        raise InputError(f"{law}: {name} = {count!r} must be a positive integer")
    if type(sample_time) not in (int, float) or not 0 < sample_time < math.inf:
        raise InputError(f"{law}: sample_time = {sample_time!r} s must be positive and finite")


@cache
def weight_names(count: int) -> tuple[str, ...]:
    """Names of a network's weights."""
    return tuple(f"w{i}" for i in range(count))


@cache
def start_of(sizes: tuple[int, ...], seed: int = 0) -> tuple[float, ...]:
    """Weights to start from, as numbers."""
    return tuple(drawn(sizes, np.random.default_rng(seed)).tolist())


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
    return by_direction(w, one, -one)


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
    whole = sum(0.0 * feature for feature in features)
    return namespace(whole).stack([feature + whole for feature in features], axis=-1)


class Seen(NamedTuple):
    """What a network sees of a motion, and what its level is multiplied by.

    z : (..., n, a) inputs of the network, within the reach
    share : (..., n) speed over reach; sign : (..., n) smooth sign of the velocity
    """

    z: Array
    share: Array
    sign: Array


def level_of(theta: Array, y: Array, share: Array, dissipative: bool, monotone: bool) -> Array:
    """Level (..., n) [N m] of a network's outputs y at speeds over reach."""
    tail = theta[..., 2]
    y = y + (softplus(tail) if monotone else tail) * share
    return theta[..., 0] * (softplus(y) if dissipative else y)
