"""A live estimate of friction: what some seconds say at a time, added up, with a band.

Each stretch is fitted as the monitor fits a recording, against the model; their curvatures add up,
so that what is kept does not grow. Noise of the motion draws fits along what is hard to separate,
gain, masses and friction together: what it does to recordings without contact is taken off. The
band is by the curvature and by how stretches scatter.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.errors import InputError

from .external_torque import Band, deviation
from .momentum_observer import Observed
from .monitor.changes import Changes, Reference, prepared_data, recording_changes
from .monitor.effects import PARTS, Effect, total_weights

# What the model knows of sensors and masses, as a share of the priors of a monitor, which asks for
# changes of these, too: 1 % of gain, 2 ms, 5 mrad, 3 % of masses.
_KNOWN = 0.02
_FEW = 4  # stretches before which nothing has converged
_REACH = 1.96  # standard errors of a 95 % band
# Variance of a change of friction, in levels: by how much it grows in a second, while a change
# explains the torque, and while none does.
_DRIFT, _OPEN = 1e-6, 3e-3


def worn(said: Observed, band: Band, before: float, change: Array) -> tuple[Array, Array, Array]:
    """Torque (K, n) that friction's change makes, half its width, and the change (2, n) after them.

    The change over the level, with its variance, by a Kalman filter. Friction changes in both
    directions of motion, and slowly: a torque that leaves the band of what was so far is none.

    before : time of the last sample [s]
    """
    mean, variance = change
    size, out = deviation(said, band.noise, band.shake), np.zeros((2, *said.torque.shape))
    steps = np.diff(said.time, prepend=before)
    for k in np.flatnonzero(said.settled):
        h, dt = said.opposing[k], float(steps[k])
        left, width = said.torque[k] - h * mean, np.abs(h) * np.sqrt(variance)
        out[:, k] = h * mean, band.factor * width
        explained = np.abs(left) <= band.factor * np.hypot(width, size[k])
        gain = explained * variance * h / (width**2 + size[k] ** 2 * max(band.response / dt, 1.0))
        mean = mean + gain * left
        variance = (1.0 - gain * h) * variance + np.where(explained, _DRIFT, _OPEN) * dt
    return *out, np.stack([mean, np.minimum(variance, 1.0)])


class Chunk(NamedTuple):
    """Samples on one clock: time (K,) [s], angle and torque (K, n)."""

    time: Array
    angle: Array
    torque: Array


def drawn_by_noise(said: Changes, effects: Sequence[Effect]) -> tuple[Array, Array]:
    """What recordings say (D,) of all effects together, beyond what they say of friction alone.

    With its covariance (D, D), that of a difference from an efficient estimate [Hausman1978].
    """
    prior = np.diag([e.size**-2.0 for e in effects])
    scores = np.linalg.solve(said.inverse, said.value[..., None]).sum(axis=0)[:, 0]
    curvature = (np.linalg.inv(said.inverse) - prior).sum(axis=0)
    friction = np.flatnonzero([e.name in PARTS for e in effects])
    covariance, alone = np.linalg.inv(curvature + prior), np.ix_(friction, friction)
    without = np.linalg.inv((curvature + prior)[alone])
    out = covariance @ scores
    out[friction] -= without @ scores[friction]
    covariance[alone] -= without
    return out, covariance


class Live(NamedTuple):
    """What stretches have said so far.

    stretches : their number; precision (D, D), pull (D,) : sums of curvature, and of it times value
    squares : sum of the stretches' distances from the mean before each, in units of the noise
    checkpoints : totals (2, n) after half of `at` stretches and after all; seconds : of data
    """

    stretches: int
    precision: Array
    pull: Array
    squares: float
    checkpoints: Array
    at: int
    seconds: float


class Estimate(NamedTuple):
    """Friction of each joint at its usual speed, over that of the model, with half its band (n,).

    band : infinite before a third stretch tells how they scatter
    converged : whether more data would hardly move it: the band is below `within`, and holds what
        at least the second half of the stretches changed
    """

    share: Array
    band: Array
    converged: bool
    seconds: float


class LiveFriction(NamedTuple):
    """Adds up what stretches say.

    Attributes
    ----------
    dataset : Dataset
        Of the machine; of its recordings the angles' noise, and whether torques are held.
    reference : Reference
        The model, its speeds and noise.
    peak : array, shape (m,)
        From which on a stretch is disturbed.
    drawn, uncertain : arrays, shapes (D,) and (D, D)
        What recordings without contact say beyond friction alone, by the noise of their motion, and
        its covariance, which no length of a stream takes away.
    within : float
        Half-width of the band, over the usual friction, at which an estimate has converged.
    """

    dataset: Dataset
    reference: Reference
    peak: Array
    drawn: Array
    uncertain: Array
    within: float = 0.05

    def torque_of(self, chunk: Chunk) -> Signal:
        """The torque of a stretch, between its samples as that of the recordings."""
        return Signal(chunk.time, chunk.torque, self.dataset.recordings[0].torque.hold)

    def start(self) -> Live:
        """Nothing said so far."""
        prior, n = self._prior, len(self.reference.speeds)
        return Live(0, prior, np.zeros(len(prior)), 0.0, np.zeros((2, n)), 0, 0.0)

    @property
    def _prior(self) -> Array:
        """Precision (D, D) of what the model knows."""
        effects = self.reference.effects
        size = np.array([e.size * (1.0 if e.name in PARTS else _KNOWN) for e in effects])
        return np.diag(size**-2.0)

    def added(self, live: Live, chunk: Chunk) -> Live:
        """With what a stretch says.

        Unchanged where it is too short, nothing moves, or most of it is disturbed: the rest would
        be fitted by as many numbers as it has rows.
        """
        angle = Signal(chunk.time, chunk.angle, sigma=self.dataset.recordings[0].angle.sigma)
        run = Recording("stretch", angle, self.torque_of(chunk))
        data = replace(self.dataset, recordings=(run,), truth=None)
        try:
            prepared = prepared_data(data)
            said, disturbed = recording_changes(prepared, self.reference, (), self.peak)
        except InputError:
            return live
        if sum(s.size for s in disturbed) > len(chunk.time) / 2:
            return live
        size = np.array([e.size for e in self.reference.effects])
        curvature = np.linalg.inv(said.inverse[0]) - np.diag(size**-2.0)
        value = said.value[0] - said.inverse[0] @ curvature @ self.drawn
        off = value - np.linalg.solve(live.precision, live.pull)
        spread = said.inverse[0] + np.linalg.inv(live.precision)
        squares = float(off @ np.linalg.solve(spread, off)) / len(off) if live.stretches else 0.0
        # value is shrunk by its prior: what the rows say is curvature-weighted
        pull = np.linalg.solve(said.inverse[0], value)
        now = live._replace(
            stretches=live.stretches + 1,
            precision=live.precision + curvature,
            pull=live.pull + pull,
            squares=live.squares + squares,
            seconds=live.seconds + float(np.ptp(chunk.time)),
        )
        if now.stretches >= 2 * max(live.at, 1):
            last = np.stack([live.checkpoints[1], self._total(now)[0]])
            now = now._replace(checkpoints=last, at=now.stretches)
        return now

    def estimate(self, live: Live) -> Estimate:
        """Friction with its band, and whether it has converged."""
        total, band = self._total(live)
        moved = np.abs(total - live.checkpoints[0])
        settled = live.stretches > _FEW <= live.at and bool((moved <= band).all())
        return Estimate(
            1.0 + total, band, settled and bool((band <= self.within).all()), live.seconds
        )

    def _total(self, live: Live) -> tuple[Array, Array]:
        """Changes (n,) of friction at the usual speed over the model's, and half their bands."""
        n, parts = len(self.reference.speeds), len(PARTS)
        curvature = live.precision - self._prior
        less = np.linalg.inv(np.eye(len(curvature)) + curvature @ self.uncertain)
        covariance = np.linalg.inv(less @ curvature + self._prior)
        value = covariance @ less @ live.pull
        rows = np.zeros((n, len(value)))
        for j, weights in enumerate(total_weights(self.reference.speeds)):
            rows[j, parts * j : parts * (j + 1)] = weights
        rows /= self.reference.level[:, None]
        excess = max(live.squares / (live.stretches - 1), 1.0) if live.stretches > 2 else np.inf
        error = np.sqrt(excess * np.einsum("jp,pq,jq->j", rows, covariance, rows))
        return rows @ value, _REACH * error
