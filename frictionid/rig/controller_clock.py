"""The controller's clock: counters that wrap around, restarts, and one time for a whole log."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.data.signals import Array

_CLOSE = 5.0  # [s] to which a counter that wraps around must agree with the host's clock
_OUTLIER = 60.0  # [s]: a single time so far from both its neighbours is a damaged number


class ClockRuns(NamedTuple):
    """Runs of the controller's clock, from start to restart.

    Attributes
    ----------
    time : array, shape (K,) [s], counters unwrapped within a run
    number : integer array, shape (K,), of the run, from 0
    kept : array of bool, shape (K,), false for rows whose time is damaged or repeated
    """

    time: Array
    number: NDArray[np.int64]
    kept: NDArray[np.bool_]


def clock_runs(time: Array, host: Array, wrap: float) -> ClockRuns:
    """Runs of a controller's clock.

    Where the time goes back, the counter has wrapped around if the host's clock agrees with that;
    else the controller has restarted.

    Parameters
    ----------
    time, host : (K,) [s], as logged
    wrap : float [s], span of the controller's counter

    Examples
    --------
    >>> host = np.arange(6.0)
    >>> clock_runs(np.array([8.0, 9.0, 0.0, 1.0, 0.5, 1.5]), host, 10.0)[:2]
    (array([ 8. ,  9. , 10. , 11. ,  0.5,  1.5]), array([0, 0, 0, 0, 1, 1]))
    """
    kept = ~_outliers(time)
    index = np.flatnonzero(kept)
    clock, seen = time[index], host[index]
    wraps, restarts = np.zeros(len(clock)), np.zeros(len(clock), dtype=np.int64)
    for k in np.flatnonzero(np.diff(clock) < 0) + 1:
        ahead = clock[k] + wrap - clock[k - 1]
        wrapped = abs(ahead - (seen[k] - seen[k - 1])) < _CLOSE and ahead < wrap / 2
        (wraps if wrapped else restarts)[k] = 1
    number, turns = np.cumsum(restarts), np.cumsum(wraps)
    first = np.searchsorted(number, number)  # of the run: a restart sets the counter to zero
    clock = clock + wrap * (turns - turns[first])
    repeated = np.zeros(len(clock), dtype=bool)
    repeated[1:] = (np.diff(clock) <= 0) & (np.diff(number) == 0)
    kept[index[repeated]] = False
    whole, numbers = time.copy(), np.zeros(len(time), dtype=np.int64)
    whole[index], numbers[index] = clock, number
    return ClockRuns(whole, numbers, kept)


def unified_time(runs: ClockRuns, host: Array) -> tuple[Array, float]:
    """Time (K,) [s] of all runs on the clock of the first, and its uncertainty at the joints [s].

    Runs are joined by the host's clock, each by the line that arrived soonest after it was sent.
    """
    time, uncertainty = runs.time.copy(), 0.0
    first, delays = 0.0, []
    for run in range(int(runs.number.max(initial=0)) + 1):
        own = (runs.number == run) & runs.kept
        if own.any():
            late = host[own] - runs.time[own]
            soonest = float(late.min())
            first = soonest if run == 0 else first
            time[runs.number == run] += soonest - first
            delays.append(float(np.median(late) - soonest))
            uncertainty = max(delays) if run else 0.0
    return time, uncertainty


def _outliers(time: Array) -> NDArray[np.bool_]:
    """Single times far from both neighbours, which themselves follow each other."""
    out = np.zeros(len(time), dtype=bool)
    if len(time) < 3:
        return out
    step = np.abs(np.diff(time))
    far = (step[:-1] > _OUTLIER) & (step[1:] > _OUTLIER)
    out[1:-1] = far & (np.abs(time[2:] - time[:-2]) < _CLOSE)
    return out
