"""Torque signals as points of the unit cube, and the motions that they make by the physics step.

Signals are multisines and chirps with their start angles. Each motor has, in this order, family,
amplitude, and a frequency, a phase and a weight of each of its sines; a chirp reads the first two
frequencies and the first phase. Start angles come last. Motions are predicted all at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, lil_array

from frictionid.arrays import Array
from frictionid.data.integrals import averages
from frictionid.data.kalman import even_series, likeliest_jerk_ratio, rts_smoother
from frictionid.data.signals import Signal
from frictionid.dynamics.rollout import rollout
from frictionid.dynamics.state import State
from frictionid.dynamics.step_size import StepSize
from frictionid.errors import InputError
from frictionid.friction import Friction

from .experiment import Experiment

FAMILIES = ("multisine", "chirp")
SINES = 5
_PER_MOTOR = 2 + 3 * SINES
_START = 0.95  # of the angle limit: the largest start angle
# Largest and smallest amplitude over the torque limit; above 1 the signal is clipped.
_OVERDRIVEN, _WEAKEST = 3.0, 0.02
DECIMALS = 6  # of a command [N m]


@dataclass(frozen=True)
class SignalSpace:
    """Torque signals of an experiment's motors, of the given families.

    Examples
    --------
    >>> from frictionid.excitation import limits_of, prior_friction_of
    >>> from frictionid.mechanics import Plant, pendulum
    >>> limits = limits_of("torque=0.5,velocity=9,angle=2", pendulum())
    >>> plant = Plant.from_parameters(pendulum(), {})
    >>> e = Experiment(plant, prior_friction_of("", limits), limits, length=1.0)
    >>> space = SignalSpace(e)
    >>> x = np.random.default_rng(0).uniform(size=(3, space.size))
    >>> space.torque(x).shape, bool(abs(space.torque(x)).max() <= 0.5), space.start(x).shape
    ((61, 3, 1), True, (3, 1))
    """

    experiment: Experiment
    families: tuple[str, ...] = FAMILIES

    def __post_init__(self) -> None:
        for family in self.families:
            if family not in FAMILIES:
                raise InputError(f"family {family!r} is unknown; known are {', '.join(FAMILIES)}")
        if not self.families:
            raise InputError(f"no family of signals is given; known are {', '.join(FAMILIES)}")

    @property
    def motors(self) -> Array:
        """Joints that have a motor."""
        return np.flatnonzero(self.experiment.plant.mechanism.driven)

    @property
    def size(self) -> int:
        """Number of coordinates of a signal."""
        return _PER_MOTOR * len(self.motors) + self.experiment.plant.n

    def sines(self, count: int) -> Array:
        """Plain sines (N, size) of frequencies all over the band, from zero angles.

        All motors in phase, at their limit. None without the family of chirps.
        """
        if "chirp" not in self.families:
            return np.zeros((0, self.size))
        x = np.full((count, self.size), 0.5)
        for i in range(len(self.motors)):
            signal = x[:, i * _PER_MOTOR : (i + 1) * _PER_MOTOR]
            signal[:, 0] = (self.families.index("chirp") + 0.5) / len(self.families)
            signal[:, 2 : 2 + SINES] = np.linspace(0.0, 1.0, count)[:, None]
            signal[:, 2 + SINES] = 0.0
        return x

    def torque(self, x: Array) -> Array:
        """Commands (K + 1, N, n) [N m] of signals x (N, size); the last one is zero."""
        e = self.experiment
        out = np.zeros((len(e.commands), len(x), e.plant.n))
        for i, joint in enumerate(self.motors):
            signal = x[:, i * _PER_MOTOR : (i + 1) * _PER_MOTOR]
            out[:, :, joint] = e.limits.torque[joint] * self._shape(signal)
        out[-1] = 0.0
        most = np.floor(e.limits.torque * 10**DECIMALS) / 10**DECIMALS
        return np.clip(np.round(out, DECIMALS), -most, most)

    def start(self, x: Array) -> Array:
        """Start angles (N, n); joints start at rest."""
        e = self.experiment
        if e.start is not None:
            return np.broadcast_to(np.array(e.start, dtype=float), (len(x), e.plant.n)).copy()
        # without a limit a revolute joint may start at any angle, a carriage at zero
        revolute = np.array([unit == "rad" for unit in e.plant.mechanism.position_units])
        free = np.where(revolute, math.pi, 0.0)
        limit = np.where(np.isfinite(e.limits.angle), _START * e.limits.angle, free)
        largest = np.where(revolute, np.minimum(limit, free), limit)
        return np.round(largest * (2 * x[:, -e.plant.n :] - 1), 3)

    def family(self, x: Array) -> list[list[str]]:
        """Family of each motor's signal, for each x."""
        chosen = [self._families(x[:, i * _PER_MOTOR]) for i in range(len(self.motors))]
        return [[self.families[k] for k in row] for row in np.array(chosen).T]

    def _families(self, x: Array) -> Array:
        return np.minimum((x * len(self.families)).astype(int), len(self.families) - 1)

    def _shape(self, x: Array) -> Array:
        """Commands as shares of the torque limit, (K + 1, N)."""
        time = self.experiment.commands
        # half of the signals exceed the limit, and are clipped there
        low, high = 2 * x[:, 1], 2 * x[:, 1] - 1
        gain = np.where(low < 1, _OVERDRIVEN ** (1 - low), _WEAKEST ** np.maximum(high, 0.0))
        f, phase, weight = np.split(x[:, 2:], 3, axis=1)
        lowest, highest = self.experiment.band
        f, phase = lowest * (highest / lowest) ** f, 2 * np.pi * phase
        angle = 2 * np.pi * time[:, None, None] * f + phase
        sines = (weight**2 * np.sin(angle)).sum(-1)
        growth = (f[:, 1] - f[:, 0]) / time[-1]
        turns = (f[:, 0] + 0.5 * growth * time[:, None]) * time[:, None]
        chirp = np.sin(2 * np.pi * turns + phase[:, 0])
        is_chirp = np.array(self.families)[self._families(x[:, 0])] == "chirp"
        wave = np.where(is_chirp, chirp, sines)
        return np.clip(gain * wave / np.maximum(np.abs(wave).max(axis=0), 1e-12), -1.0, 1.0)


MARGIN = 0.95  # of a limit: the machine will not move exactly as predicted
# Substeps of an interval in the search: a quarter of the cost, some mrad off after seconds.
QUICK = StepSize(2, 4)


class Motions(NamedTuple):
    """Motions at the camera's times for L friction scales and N signals.

    q, w (T + 1, L, N, n); u (T, N, n) mean torque of each interval.
    """

    q: Array
    w: Array
    u: Array

    def pick(self, index: Array) -> Motions:
        """Motions of some of the signals."""
        return Motions(self.q[:, :, index], self.w[:, :, index], self.u[:, index])

    def within(self, experiment: Experiment) -> Array:
        """Whether each signal keeps the limits, with a margin, at all friction scales, (N,)."""
        limits = experiment.limits
        with np.errstate(invalid="ignore"):  # a motion that diverged keeps no limit
            slow = np.abs(self.w) <= MARGIN * limits.velocity
            near = (np.abs(self.q) <= MARGIN * limits.angle) & np.isfinite(self.q)
        return np.asarray((slow & near).all(axis=(0, 1, 3)))


def predict_motions(
    experiment: Experiment, torque: Array, start: Array, *, quick: bool = False
) -> Motions:
    """Motions under commands (K + 1, N, n) from start angles (N, n), at rest.

    `quick` takes few substeps, accurate enough for a search.
    """
    images = experiment.images
    flat = Signal(experiment.commands, torque.reshape(len(torque), -1), hold="previous")
    u = averages(flat, images).reshape(len(images) - 1, *torque.shape[1:])
    theta = np.multiply.outer(np.array(experiment.friction_scales), experiment.friction.theta)
    friction = Friction(experiment.friction.law, theta[:, None])
    state, size = State(start, 0.0 * start), QUICK if quick else None
    out = rollout(experiment.plant, friction, state, u, np.diff(images), step_size=size)
    return Motions(out.q, out.w, u)


_SUPPORT = 60  # samples; a smoothed state depends on those farther away by less than 1e-6
_DECADES = 4  # parts of a decade to which jerk ratios are rounded


def jerk_decades(q: Array, dt: float) -> Array:
    """Decades of the likeliest jerk ratio of noisy angles q (T, ...), (...), rounded to a quarter.

    One series for each entry of the other axes.
    """
    decades = np.log10(likeliest_jerk_ratio(even_series(q.reshape(len(q), -1), dt)))
    return (np.round(_DECADES * decades) / _DECADES).reshape(q.shape[1:])


def smoothed_states(q: Array, decades: Array, dt: float) -> tuple[Array, Array]:
    """Smoothed angles and velocities of angles q (T, ...), by decades of the jerk ratio (...)."""
    out = rts_smoother(even_series(q.reshape(len(q), -1), dt), 10.0 ** decades.ravel())
    return out[:, :, 0].reshape(q.shape), out[:, :, 1].reshape(q.shape)


@lru_cache(maxsize=96)
def smoother_gains(samples: int, dt: float, decade: float) -> tuple[csr_array, csr_array]:
    """Matrices (T, T) from angles to smoothed angles and velocities [1/s].

    >>> angle, velocity = smoother_gains(5, 0.1, 8.0)
    >>> line = np.arange(5) * 0.1
    >>> bool(np.allclose(angle @ line, line)), bool(np.allclose(velocity @ line, 1.0, atol=1e-3))
    (True, True)
    """
    size = min(samples, 2 * _SUPPORT + 1)
    response = rts_smoother(even_series(np.eye(size), dt), np.full(size, 10.0**decade))
    return _banded(response[:, :, 0], samples), _banded(response[:, :, 1], samples)


def _banded(response: Array, samples: int) -> csr_array:
    """The same response at the ends of a longer recording, its middle row between them."""
    size = len(response)
    half = size // 2
    out = lil_array((samples, samples))
    for i in range(samples):
        row = min(i, half) if i < samples - half else size - (samples - i)
        out[i, i - row : i - row + size] = response[row]
    return out.tocsr()
