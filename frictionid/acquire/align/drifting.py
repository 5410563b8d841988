"""Shooting with a drifting torque clock: delay and drift of the torque are parameters.

The torque logged at time t acts at t + delay + drift (t - middle). Within a sample interval that is
a delay, so that the derivatives by the drift are (t - middle) times those by the delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting.intervals import Track
from frictionid.shooting.linearise import Intervals, Lines, intervals_of, parts_of
from frictionid.shooting.parameters import Block, DelayBlock
from frictionid.shooting.parameters.parameter_block import Entry, Guess
from frictionid.shooting.settings import Settings

MAX_DRIFT = 0.01
DRIFT_SIGMA = 5e-4  # prior standard deviation: of quartz clocks


@dataclass(frozen=True)
class ClockCalibration(Calibration):
    """A calibration with a torque clock that drifts: `drift` () [1], positive where it is slow."""

    drift: float = 0.0


@dataclass(frozen=True)
class DriftBlock:
    """Drift of the torque's clock [1]; `prior` is its prior standard deviation."""

    prior: float = DRIFT_SIGMA
    name: str = "drift"
    enters: str = "torque"

    def entries(self, guess: Guess) -> tuple[Entry, ...]:
        drift = guess.calibration.drift if isinstance(guess.calibration, ClockCalibration) else 0.0
        return (Entry(self.name, "clock drift", "1", drift, -MAX_DRIFT, MAX_DRIFT, self.prior),)

    def put(self, guess: Guess, entries: Sequence[Entry], values: Array) -> Guess:
        own = {f: getattr(guess.calibration, f) for f in Calibration.__dataclass_fields__}
        return guess._replace(calibration=ClockCalibration(**own, drift=float(values[0])))


@dataclass(frozen=True, eq=False)
class Drifting(Intervals):
    """Intervals whose torque has a clock of its own, right at `middle` [s] but for its delay."""

    inner: Intervals
    middle: float

    def lines(self, guess: Guess, nodes: Array, rows: Array) -> Lines:
        """Ends and derivatives of some intervals that begin at nodes (K, s)."""
        drift = guess.calibration.drift if isinstance(guess.calibration, ClockCalibration) else 0.0
        own = replace(self.inner, track=drifted(self.track, drift, self.middle))
        found = own.lines(guess, nodes, rows)
        places = {e: k for k, e in enumerate(_names(self.inner))}
        by = np.zeros((*found.by.shape[:-1], self.count))
        angle = np.zeros((self.count, self.track.n))
        since = (self.track.time + self.track.dt / 2 - self.middle)[:, None]
        for k, name in enumerate(_names(self)):
            if name[0] == "drift":
                by[..., k] = since * found.by[..., places["delay", "torque delay"]]
            else:
                by[..., k], angle[k] = found.by[..., places[name]], found.angle[places[name]]
        return Lines(found.end, found.by_start, by, angle)


def drifting(
    track: Track, guess: Guess, blocks: Sequence[Block], settings: Settings, middle: float
) -> Drifting:
    """Intervals of a track with delay, drift and other blocks free."""
    delay = DelayBlock()
    inner = intervals_of(track, guess, (*blocks, delay), settings)
    parts = parts_of((*blocks, delay, DriftBlock()), guess)
    return Drifting(track, parts, settings, inner.seen, inner, middle)


def drifted(track: Track, drift: float, middle: float) -> Track:
    """The track with its torque on the drifting clock."""
    recordings = tuple(
        replace(r, torque=r.torque._replace(time=r.torque.time + drift * (r.torque.time - middle)))
        for r in track.dataset.recordings
    )
    return replace(track, dataset=replace(track.dataset, recordings=recordings))


def _names(intervals: Intervals) -> list[tuple[str, str]]:
    return [(e.block, e.name) for part in intervals.parts for e in part.entries]
