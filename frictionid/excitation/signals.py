"""Torque signals as points of the unit cube: multisines and chirps with their start angles.

Each motor has, in this order, family, amplitude, and a frequency, a phase and a weight of each of
its sines; a chirp reads the first two frequencies and the first phase. Start angles come last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.excitation.experiment import Experiment

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
    >>> from frictionid.excitation.prior_friction import prior_friction_of
    >>> from frictionid.excitation.limits import limits_of
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
            own = x[:, i * _PER_MOTOR : (i + 1) * _PER_MOTOR]
            own[:, 0] = (self.families.index("chirp") + 0.5) / len(self.families)
            own[:, 2 : 2 + SINES] = np.linspace(0.0, 1.0, count)[:, None]
            own[:, 2 + SINES] = 0.0
        return x

    def torque(self, x: Array) -> Array:
        """Commands (K + 1, N, n) [N m] of signals x (N, size); the last one is zero."""
        e = self.experiment
        out = np.zeros((len(e.commands), len(x), e.plant.n))
        for i, joint in enumerate(self.motors):
            own = x[:, i * _PER_MOTOR : (i + 1) * _PER_MOTOR]
            out[:, :, joint] = e.limits.torque[joint] * self._shape(own)
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
        f, phase = self._frequency(f), 2 * np.pi * phase
        angle = 2 * np.pi * time[:, None, None] * f + phase
        sines = (weight**2 * np.sin(angle)).sum(-1)
        growth = (f[:, 1] - f[:, 0]) / time[-1]
        turns = (f[:, 0] + 0.5 * growth * time[:, None]) * time[:, None]
        chirp = np.sin(2 * np.pi * turns + phase[:, 0])
        is_chirp = np.array(self.families)[self._families(x[:, 0])] == "chirp"
        wave = np.where(is_chirp, chirp, sines)
        return np.clip(gain * wave / np.maximum(np.abs(wave).max(axis=0), 1e-12), -1.0, 1.0)

    def _frequency(self, x: Array) -> Array:
        low, high = self.experiment.band
        return low * (high / low) ** x
