"""Smoothed motion of the recordings under check, with its noise and typical speeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.data.integrals import SignalIntegrals, integrals_of
from frictionid.data.kalman import by_length
from frictionid.data.outliers import Smoothed, smoothed
from frictionid.data.plants import plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, sample
from frictionid.data.state_estimators import States, noise_left, resolutions
from frictionid.fitting.one_step.balances import Balances, Rows, Samples, Windows, balances_of
from frictionid.mechanics import Mechanism, Plant

# Finer samples are averaged: friction and rigid bodies show below 30 Hz, and each step costs time.
FINEST = 0.004
# Fewest different readings that show a sensor's quantisation step.
DISTINCT = 12
# A joint moves where its fast speed is this many times the noise, and so is what it goes through.
ABOVE = 6.0


class Motion(NamedTuple):
    """Estimated motion of one recording.

    states : time (T,) [s], q (T, n) [rad], w (T, n) [rad/s]
    angle_noise : (n,) [rad] standard deviation of the measured angle about the smooth motion
    velocity_noise : (n,) [rad/s] standard deviation of w
    blur : (n,) [s] over which the smoother spreads a sudden change of acceleration, one over
        its bandwidth
    """

    states: States
    angle_noise: Array
    velocity_noise: Array
    blur: Array


def motions_of(recordings: Sequence[Recording]) -> tuple[Motion, ...]:
    """Motion of each recording, by the smoother of `states.RTS` with its own uncertainty.

    The angle noise follows from what the smoother took off, see `noise_left`, and is at least that
    of rounding to the angle's quantisation step.

    Examples
    --------
    >>> t = np.arange(300) / 60
    >>> noise = 0.002 * np.random.default_rng(0).standard_normal((300, 1))
    >>> angle = Signal(t, np.sin(3 * t)[:, None] + noise)
    >>> motion = motions_of([Recording("swing", angle, Signal(t, 0 * noise))])[0]
    >>> float(motion.angle_noise[0].round(4))
    0.002
    """
    angles = [_averaged(recording.angle) for recording in recordings]
    each = zip(recordings, angles, by_length(angles, smoothed), strict=True)
    return tuple(_motion(r, angle, Smoothed(*parts)) for r, angle, parts in each)


def _motion(recording: Recording, angle: Signal, smooth: Smoothed) -> Motion:
    bandwidth, share, velocity = noise_left(smooth.rho, usual_step(angle.time))
    mean, left_out = smooth.mean, smooth.left_out
    scatter = (angle.value - mean[..., 0]).var(axis=0, where=~left_out)
    step, count = resolutions(recording.angle.value, DISTINCT), len(recording.angle.time)
    rounding = step**2 / 12 / (count // len(angle.time))  # of averaged samples
    variance = np.maximum(scatter / np.maximum(1.0 - share, 0.05), rounding)
    base = recording.base_motion
    along = None if base is None else sample(base, angle.time)
    states = States(angle.time, mean[..., 0], mean[..., 1], left_out, base_motion=along)
    noise = np.sqrt(variance)
    return Motion(states, noise, noise * velocity, 1.0 / bandwidth)


class Speeds(NamedTuple):
    """Characteristic speeds (..., n) [rad/s] of each joint.

    threshold : below it a joint may be at rest (noise, or 2 % of fast motion), infinite for a joint
    that never rises from the noise ; fast : exceeded in 5 % of the time, or half the mean speed
    along the way, in which rest does not count, as where each recording moves another joint
    """

    threshold: Array
    fast: Array


def speeds_of(motions: Sequence[Motion]) -> Speeds:
    """Characteristic speeds of the joints over all motions, (n,) each."""
    noise = np.array([m.velocity_noise for m in motions])
    speeds = characteristic_speeds(np.concatenate([m.states.w for m in motions]), noise)
    moves = [np.ptp(m.states.q, axis=0) > ABOVE * m.angle_noise for m in motions]
    return speeds._replace(threshold=np.where(np.any(moves, axis=0), speeds.threshold, np.inf))


def characteristic_speeds(w: Array, noise: Array) -> Speeds:
    """Characteristic speeds (..., n) of velocities w (..., T, n) with the noise (..., R, n)."""
    noise, speed = np.median(noise, axis=-2), np.abs(w)
    along = (speed**2).sum(axis=-2) / np.maximum(speed.sum(axis=-2), 1e-300)
    fast = np.maximum(np.quantile(speed, 0.95, axis=-2), along / 2)
    threshold = np.where(fast < ABOVE * noise, np.inf, np.maximum(3.0 * noise, 0.02 * fast))
    return Speeds(threshold, np.maximum(fast, 1e-12))


def sliding_speeds(mechanism: Mechanism, motions: Sequence[Motion]) -> Speeds:
    """Characteristic speeds (m,) where parts slide: of the joints, then of coupled parts."""
    if not mechanism.coupled:
        return speeds_of(motions)
    return speeds_of([mapped_motion(motion, mechanism.friction_map) for motion in motions])


def unit_balances(mechanism: Mechanism, motions: Sequence[Motion]) -> Balances:
    """Balances of the motions for the units of the base parameters: responses to them."""
    samples = Samples.joined([motion.states for motion in motions])
    return balances_of(mechanism, samples, None, *sliding_speeds(mechanism, motions))


def mapped_motion(motion: Motion, map_: Array, offset: Array | float = 0.0) -> Motion:
    """Motion after a linear map (m, n) of velocities and angles, to which an offset is added."""
    s = motion.states
    angle, velocity = (np.sqrt(map_**2 @ v**2) for v in (motion.angle_noise, motion.velocity_noise))
    blur = ((map_ != 0) * motion.blur).max(1)
    return Motion(s._replace(q=s.q @ map_.T + offset, w=s.w @ map_.T), angle, velocity, blur)


@dataclass(frozen=True, eq=False)
class Measured:
    """Recordings under check: a data set with its smoothed motions and logged torques.

    dataset : R recordings ; plant : the nominal mechanism with its parameters, one batch entry for
    each ; motions : R of them ; torque : integrals of the logged torques

    `motions` and `torque` may be corrected by a linear map; `dataset` stays as recorded, but for
    outliers of the torque.
    dead : joints (from 0) whose torques show nothing, so that their balances do not count
    """

    dataset: Dataset
    plant: Plant
    motions: tuple[Motion, ...]
    torque: SignalIntegrals
    dead: tuple[int, ...] = ()

    @staticmethod
    def of_dataset(dataset: Dataset, motions: Sequence[Motion]) -> Measured:
        """A data set with its motions, torques as logged."""
        return Measured(dataset, plant_of(dataset), tuple(motions), _integrals(dataset))

    def with_torques_of(self, dataset: Dataset) -> Measured:
        """The motions with the torques of a data set."""
        return replace(self, dataset=dataset, torque=_integrals(dataset))

    @property
    def mechanism(self) -> Mechanism:
        """The nominal mechanism."""
        return self.plant.mechanism

    @property
    def nominal(self) -> Array:
        """Nominal base parameters (R, nb)."""
        return self.plant.p

    @property
    def pairs(self) -> Iterator[tuple[Recording, Motion]]:
        """The recordings, each with its motion."""
        return zip(self.dataset.recordings, self.motions, strict=True)

    @cached_property
    def speeds(self) -> Speeds:
        """Characteristic speeds of the joints."""
        return speeds_of(self.motions)

    @cached_property
    def balances(self) -> Balances:
        """Balances of the motions for the units of the base parameters."""
        return unit_balances(self.mechanism, self.motions)

    @cached_property
    def windows(self) -> Windows:
        """Windows of the usual width."""
        return self.balances.samples.windows(WIDTH)

    @cached_property
    def rows(self) -> Rows:
        """Rows of the windows of the usual width."""
        return self.balances.rows(self.windows)

    @property
    def momentum_noise(self) -> Array:
        """Noise (n,) [N m s] of the joints' changes of momentum, by that of two velocities."""
        rest = np.zeros((1, self.mechanism.n))
        inertia = np.diagonal(self.mechanism.dynamics(self.nominal[0], rest, rest)[0][0])
        velocity = np.median([m.velocity_noise for m in self.motions], axis=0)
        return np.abs(inertia) * velocity * np.sqrt(2.0)

    def without(self, recordings: set[int]) -> Measured:
        """The data without some recordings, or all of them where none would remain."""
        kept = [i for i in range(len(self.motions)) if i not in recordings]
        if not recordings or not kept:
            return self
        part = replace(self.dataset, recordings=tuple(self.dataset.recordings[i] for i in kept))
        motions = tuple(self.motions[i] for i in kept)
        return replace(self, plant=self.plant[kept], motions=motions).with_torques_of(part)

    def with_base(self, change: Array) -> Measured:
        """The data under other nominal base parameters, each larger by a change (nb,)."""
        return replace(self, plant=replace(self.plant, p=self.nominal + change))

    def mapped(self, angle: Array, torque: Array, offset: Array | float = 0.0) -> Measured:
        """The data after linear maps (n, n) of angles, with an offset, and of torques."""
        motions = tuple(mapped_motion(motion, angle, offset) for motion in self.motions)
        return replace(self, motions=motions, torque=self.torque.mapped(torque))


def _integrals(dataset: Dataset) -> SignalIntegrals:
    return integrals_of([recording.torque for recording in dataset.recordings])


def _averaged(angle: Signal) -> Signal:
    """Means over neighbouring samples that are closer than FINEST, time and angle alike."""
    count = round(FINEST / usual_step(angle.time))
    blocks = len(angle.time) // max(count, 1)
    if count < 2 or blocks < 2:
        return angle
    used = blocks * count
    value = angle.value[:used].reshape(blocks, count, -1).mean(axis=1)
    return angle._replace(time=angle.time[:used].reshape(blocks, count).mean(axis=1), value=value)


# Long enough that the noise of two velocities does not hide friction, short enough to lie between
# two reversals of a swinging joint.
WIDTH = 0.15
# Where the smoother's blur is below this share of a window, windows may be shorter, down to this
# [s], and may hold a reversal of the joint.
SHARP, SHORTEST = 1 / 30, 0.05
# Fewest windows of motion of a joint that a statement about it needs.
MIN_WINDOWS = 20


def unit_rows(mechanism: Mechanism, motions: Sequence[Motion]) -> Rows:
    """Rows whose parameter vectors are the units of the base parameters: responses to them."""
    return windows_of(unit_balances(mechanism, motions))


def windows_of(balances: Balances, width: float = WIDTH, reversals: bool = False) -> Rows:
    """Rows of balances over all windows of a width [s]."""
    return balances.rows(balances.samples.windows(width), reversals=reversals)


def adapted(balances: Balances, motions: Sequence[Motion]) -> Rows:
    """Rows for the estimates: windows as short as the smoother's blur allows.

    Real friction is not quite Coulomb and viscous, so that least squares depend on which speeds and
    accelerations count. Without the reversals of `emps`, where friction is lower than at any speed,
    its Coulomb friction comes out 5 % higher and the viscous one 5 % lower; long windows take 1 %
    of its mass. Published values come from all samples. A noisy motion, however, is blurred, worst
    at reversals, where the acceleration jumps: at 60 Hz with 3 mrad, short windows and reversals
    cost 1 to 2 % of the inertias and 15 % of viscous friction (simulated), and are left out.
    """
    blur = float(np.median([m.blur.max() for m in motions]))
    if blur > SHARP * WIDTH:
        return windows_of(balances)
    return windows_of(balances, max(blur / SHARP, SHORTEST), reversals=True)
