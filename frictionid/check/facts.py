"""Facts of the recordings, joint by joint: motion, torque, clock, noise and resolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from frictionid.arrays import Array
from frictionid.check.fine_structure import resolution, scatter_of
from frictionid.check.motion import Motion, speeds_of
from frictionid.data.recordings import Recording

# Intervals around one whose median is the usual one where the sampling rate changes.
NEIGHBOURS = 21
GAP = 5.0  # of the usual intervals


@dataclass(frozen=True)
class JointFacts:
    """Facts of one joint; SI units.

    range : span of all angles ; fast : speed exceeded in 5 % of the time ; top : largest speed ;
    forward : share of the moving time in the positive direction ; at_rest : share of the time below
    `rest_speed` ; reversals : changes of direction ; torque : RMS ; torque_top ; torque_noise and
    angle_noise : standard deviations ; velocity_noise : of the smoothed velocity ; angle_step and
    torque_step : resolution, 0 where there is none
    """

    joint: int
    range: float
    fast: float
    top: float
    rest_speed: float
    at_rest: float
    forward: float
    reversals: int
    torque: float
    torque_top: float
    angle_noise: float
    velocity_noise: float
    torque_noise: float
    angle_step: float
    torque_step: float


@dataclass(frozen=True)
class ClockFacts:
    """Facts of the angles' clock: recordings, duration [s], rate [Hz], jitter and losses.

    rate, slowest, fastest : usual sampling rate and the range of its changes ; jitter : standard
    deviation of the sample intervals over the usual one of their neighbourhood, gaps left out ;
    dropped : samples missing at 1.5 to 5 of these ; gaps : intervals longer than GAP
    """

    recordings: int
    duration: float
    samples: int
    rate: float
    slowest: float
    fastest: float
    jitter: float
    dropped: int
    gaps: int
    longest_gap: float


def clock_of(recordings: Sequence[Recording]) -> ClockFacts:
    """Facts of the clock of the angles.

    >>> from frictionid.data.signals import Signal
    >>> time = np.delete(np.arange(100) * 0.01, [20, 50, 51])
    >>> angle = Signal(time, np.zeros((97, 1)))
    >>> clock = clock_of([Recording("a", angle, angle)])
    >>> clock.dropped, clock.gaps
    (3, 0)

    A change of the sampling rate is no loss:

    >>> twice = np.concatenate([np.arange(100) * 0.01, 1.0 + np.arange(100) * 0.02])
    >>> clock = clock_of([Recording("a", Signal(twice, np.zeros((200, 1))), angle)])
    >>> clock.dropped, round(clock.slowest), round(clock.fastest)
    (0, 50, 100)
    """
    steps = [np.diff(r.angle.time) for r in recordings]
    dt, middle = np.concatenate(steps), np.concatenate([usual_intervals(s) for s in steps])
    ratio = dt / middle
    lost = (ratio > 1.5) & (ratio <= GAP)
    plain = ratio <= 1.5
    return ClockFacts(
        recordings=len(recordings),
        duration=float(sum(np.ptp(r.angle.time) for r in recordings)),
        samples=len(dt) + len(recordings),
        rate=float(1.0 / np.median(middle)),
        slowest=float(1.0 / np.quantile(middle, 0.99)),
        fastest=float(1.0 / np.quantile(middle, 0.01)),
        jitter=float(np.std(ratio[plain])) if plain.any() else 0.0,
        dropped=int(np.rint(ratio[lost] - 1).sum()),
        gaps=int((ratio > GAP).sum()),
        longest_gap=float(dt[ratio > 1.5].max(initial=0.0)),
    )


def usual_intervals(intervals: Array) -> Array:
    """Usual interval around each one: the median of NEIGHBOURS of them, or of the recording.

    Of the recording, unless the sampling rate changes: then most of a neighbourhood is longer or
    shorter by a factor that lost samples would not leave there.
    """
    whole = np.full(len(intervals), np.median(intervals) if len(intervals) else np.nan)
    if len(intervals) < NEIGHBOURS:
        return whole
    near = median_filter(intervals, NEIGHBOURS, mode="mirror")
    ratio = near / whole
    return np.where((ratio > 1.4) | (ratio < 1 / 1.4), near, whole)


def joints_of(recordings: Sequence[Recording], motions: Sequence[Motion]) -> list[JointFacts]:
    """Facts of each joint."""
    w = np.concatenate([m.states.w for m in motions])
    q = np.concatenate([r.angle.value for r in recordings])
    u = np.concatenate([r.torque.value for r in recordings])
    threshold, fast = speeds_of(motions)
    angle_noise = np.median([m.angle_noise for m in motions], axis=0)
    velocity_noise = np.median([m.velocity_noise for m in motions], axis=0)
    out = []
    for j in range(w.shape[1]):
        moving = np.abs(w[:, j]) > threshold[j]
        out.append(
            JointFacts(
                joint=j + 1,
                range=float(np.ptp(q[:, j])),
                fast=float(fast[j]),
                top=float(np.abs(w[:, j]).max()),
                rest_speed=float(threshold[j]),
                at_rest=float(1 - moving.mean()),
                forward=float((w[moving, j] > 0).mean()) if moving.any() else 0.0,
                reversals=sum(_reversals(m.states.w[:, j], threshold[j]) for m in motions),
                torque=float(np.sqrt((u[:, j] ** 2).mean())),
                torque_top=float(np.abs(u[:, j]).max()),
                angle_noise=float(angle_noise[j]),
                velocity_noise=float(velocity_noise[j]),
                torque_noise=_ripple(recordings, j),
                angle_step=resolution(q[:, j]),
                torque_step=resolution(u[:, j]),
            )
        )
    return out


def _reversals(w: Array, threshold: float) -> int:
    side = np.sign(w[np.abs(w) > threshold])
    return int((side[1:] != side[:-1]).sum())


def _ripple(recordings: Sequence[Recording], j: int) -> float:
    """Standard deviation of white noise on the torque, from second differences, robustly."""
    second = np.concatenate([np.diff(r.torque.value[:, j], n=2) for r in recordings])
    return scatter_of(second) / float(np.sqrt(6))
