"""Facts of the clock of the angles: rate, jitter, dropped samples and gaps; runs of samples."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from frictionid.arrays import Array

# Intervals around one whose median is the usual one where the sampling rate changes.
NEAR_INTERVALS = 21
GAP = 5.0  # of the usual intervals


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


def clock_of(times: Sequence[Array]) -> ClockFacts:
    """Facts of the clock of the angles, from the times [s] of each recording.

    >>> time = np.delete(np.arange(100) * 0.01, [20, 50, 51])
    >>> clock = clock_of([time])
    >>> clock.dropped, clock.gaps
    (3, 0)

    A change of the sampling rate is no loss:

    >>> twice = np.concatenate([np.arange(100) * 0.01, 1.0 + np.arange(100) * 0.02])
    >>> clock = clock_of([twice])
    >>> clock.dropped, round(clock.slowest), round(clock.fastest)
    (0, 50, 100)
    """
    steps = [np.diff(time) for time in times]
    dt, middle = np.concatenate(steps), np.concatenate([usual_intervals(s) for s in steps])
    ratio = dt / middle
    lost = (ratio > 1.5) & (ratio <= GAP)
    plain = ratio <= 1.5
    return ClockFacts(
        recordings=len(times),
        duration=float(sum(np.ptp(time) for time in times)),
        samples=len(dt) + len(times),
        rate=float(1.0 / np.median(middle)),
        slowest=float(1.0 / np.quantile(middle, 0.99)),
        fastest=float(1.0 / np.quantile(middle, 0.01)),
        jitter=float(np.std(ratio[plain])) if plain.any() else 0.0,
        dropped=int(np.rint(ratio[lost] - 1).sum()),
        gaps=int((ratio > GAP).sum()),
        longest_gap=float(dt[ratio > 1.5].max(initial=0.0)),
    )


def usual_intervals(intervals: Array) -> Array:
    """Usual interval around each one: the median of NEAR_INTERVALS of them, or of the recording.

    Of the recording, unless the sampling rate changes: then most of a neighbourhood is longer or
    shorter by a factor that lost samples would not leave there.
    """
    whole = np.full(len(intervals), np.median(intervals) if len(intervals) else np.nan)
    if len(intervals) < NEAR_INTERVALS:
        return whole
    near = median_filter(intervals, NEAR_INTERVALS, mode="mirror")
    ratio = near / whole
    return np.where((ratio > 1.4) | (ratio < 1 / 1.4), near, whole)


def run_edges(flags: Array) -> tuple[Array, Array]:
    """First samples of the runs of true flags (T,), and the samples behind them.

    >>> [edge.tolist() for edge in run_edges(np.array([True, True, False, True]))]
    [[0, 3], [2, 4]]
    """
    edges = np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0))
    return edges[::2], edges[1::2]
