"""Torque commands of the simulated drive: one family of wave forms per class."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from frictionid.config import NotNegative, Positive, check_settings
from frictionid.data.signals import Array
from frictionid.errors import InputError


class Command(ABC):
    """A wave form of the torque."""

    def __post_init__(self) -> None:
        check_settings(self)

    @abstractmethod
    def values(self, time: Array, generator: np.random.Generator) -> Array:
        """Command at increasing times (T,) [s], shape (T,) [N m]."""


@dataclass(frozen=True)
class Sine(Command):
    """offset + amplitude sin(2 pi frequency t + phase); [N m], [Hz], [rad].

    >>> generator = np.random.default_rng(0)
    >>> Sine(0.1, frequency=0.25).values(np.arange(4.0), generator).round(6) + 0.0
    array([ 0. ,  0.1,  0. , -0.1])
    """

    amplitude: float
    frequency: Positive
    phase: float = 0.0
    offset: float = 0.0
    kind: Literal["sine"] = "sine"

    def values(self, time: Array, generator: np.random.Generator) -> Array:  # noqa: ARG002
        wave: Array = np.sin(2 * np.pi * self.frequency * time + self.phase)
        return self.offset + self.amplitude * wave


@dataclass(frozen=True)
class Chirp(Command):
    """Sine whose frequency [Hz] changes linearly from the first to the last sample.

    >>> Chirp(0.1, 1.0, 2.0).values(np.array([0.0, 1.0]), np.random.default_rng(0)).round(6) + 0.0
    array([0., 0.])
    """

    amplitude: float
    start_frequency: Positive
    stop_frequency: Positive
    kind: Literal["chirp"] = "chirp"

    def values(self, time: Array, generator: np.random.Generator) -> Array:  # noqa: ARG002
        since = time - time[0]
        growth = (self.stop_frequency - self.start_frequency) / max(since[-1], 1e-9)
        turns = (self.start_frequency + 0.5 * growth * since) * since
        return self.amplitude * np.sin(2 * np.pi * turns)


@dataclass(frozen=True)
class Steps(Command):
    """Levels drawn evenly from -amplitude to amplitude, each held for `hold` [s].

    >>> generator = np.random.default_rng(0)
    >>> len(set(Steps(0.1, hold=0.5).values(np.linspace(0.0, 0.9, 10), generator)))
    2
    """

    amplitude: NotNegative
    hold: Positive
    kind: Literal["steps"] = "steps"

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        # a sample at a change belongs to the new level, also after rounding
        number = np.floor((time - time[0]) / self.hold + 1e-9).astype(int)
        levels: Array = generator.uniform(-self.amplitude, self.amplitude, number[-1] + 1)
        return levels[number]


@dataclass(frozen=True)
class Multisine(Command):
    """Sines of equal height and random phase at some frequencies [Hz], with the amplitude as peak.

    >>> generator = np.random.default_rng(0)
    >>> float(abs(Multisine(0.1, (1.0, 2.5)).values(np.linspace(0, 3, 99), generator)).max())
    0.1
    """

    amplitude: NotNegative
    frequencies: Annotated[tuple[Positive, ...], Field(min_length=1)]
    kind: Literal["multisine"] = "multisine"

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        phases = generator.uniform(0.0, 2 * np.pi, len(self.frequencies))
        turns = np.outer(time, self.frequencies)
        wave: Array = np.sin(2 * np.pi * turns + phases).sum(axis=1)
        return wave * (self.amplitude / np.abs(wave).max())


@dataclass(frozen=True)
class Noise(Command):
    """White noise between two frequencies [Hz] with half the amplitude as deviation, cut off at it.

    >>> generator = np.random.default_rng(0)
    >>> float(abs(Noise(0.1, (0.5, 2.0)).values(np.linspace(0, 9, 99), generator)).max())
    0.1
    """

    amplitude: NotNegative
    band: tuple[float, float]
    kind: Literal["noise"] = "noise"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.band[0] < self.band[1]:
            raise InputError(f"band must be two increasing frequencies, not {list(self.band)}")

    def values(self, time: Array, generator: np.random.Generator) -> Array:
        low, high = self.band
        white = np.fft.rfft(generator.standard_normal(len(time)))
        frequency = np.fft.rfftfreq(len(time), (time[-1] - time[0]) / (len(time) - 1))
        # second-order edges: sharp ones would ring through the whole recording
        shape = 1.0 / np.sqrt(1.0 + (frequency / high) ** 4)
        shape[1:] /= np.sqrt(1.0 + (low / frequency[1:]) ** 4)
        shape[0] *= low == 0
        wave = np.fft.irfft(white * shape, len(time))
        half = 0.5 * self.amplitude / max(float(wave.std()), 1e-300)
        return np.clip(half * wave, -self.amplitude, self.amplitude)


AnyCommand = Annotated[Sine | Chirp | Steps | Multisine | Noise, Field(discriminator="kind")]
