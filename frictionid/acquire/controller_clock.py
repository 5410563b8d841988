"""The controller's clock: counters that begin anew, restarts, and one time for all of a log."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from frictionid.data.signals import Array

_NEAR = 5.0  # [s], how well a counter that begins anew must agree with the host's clock
_OUTLIER = 60.0  # [s], a single time so far from both its neighbours is a damaged number


class Runs(NamedTuple):
    """Runs of the controller's clock, from start to restart.

    time : (K,) [s], counters unwound within a run; number : (K,), of the run, from 0
    kept : (K,), rows without those whose time is damaged or was there before
    """

    time: Array
    number: NDArray[np.int64]
    kept: NDArray[np.bool_]


def runs_of(time: Array, host: Array, wrap: float) -> Runs:
    """Runs of a controller's clock.

    A time that goes down is a counter that began anew where the host's clock agrees with that;
    else the controller has restarted.

    Parameters
    ----------
    time, host : (K,) [s], as logged
    wrap : float [s], span of the controller's counter

    Examples
    --------
    >>> host = np.arange(6.0)
    >>> runs_of(np.array([8.0, 9.0, 0.0, 1.0, 0.5, 1.5]), host, 10.0)[:2]
    (array([ 8. ,  9. , 10. , 11. ,  0.5,  1.5]), array([0, 0, 0, 0, 1, 1]))
    """
    kept = ~_outliers(time)
    index = np.flatnonzero(kept)
    clock, seen = time[index], host[index]
    back = np.flatnonzero(np.diff(clock) < 0) + 1
    turns, number = np.zeros(len(clock)), np.zeros(len(clock), dtype=np.int64)
    for k in back:
        ahead = clock[k] + wrap - clock[k - 1]
        wrapped = abs(ahead - (seen[k] - seen[k - 1])) < _NEAR and ahead < wrap / 2
        (turns if wrapped else number)[k] = 1
    number = np.cumsum(number)
    # a restart sets the counter to its own beginning
    since = np.cumsum(turns)
    first = np.searchsorted(number, number)
    clock = clock + wrap * (since - since[first])
    again = np.zeros(len(clock), dtype=bool)
    again[1:] = (np.diff(clock) <= 0) & (np.diff(number) == 0)
    kept[index[again]] = False
    whole, numbers = time.copy(), np.zeros(len(time), dtype=np.int64)
    whole[index], numbers[index] = clock, number
    return Runs(whole, numbers, kept)


def one_clock(runs: Runs, host: Array) -> tuple[Array, float]:
    """One time (K,) [s] for all runs, that of the first, and how unsure the joints are [s].

    Later runs are joined by the host's clock: each by the line that came soonest after it was sent.
    """
    time, unsure = runs.time.copy(), 0.0
    shifts, scatter = [], []
    for run in range(int(runs.number.max(initial=0)) + 1):
        own = (runs.number == run) & runs.kept
        if not own.any():
            shifts.append(0.0)
            continue
        late = host[own] - runs.time[own]
        shifts.append(float(late.min()))
        scatter.append(float(np.median(late) - late.min()))
        time[runs.number == run] += shifts[run] - shifts[0]
        unsure = max(scatter) if run else 0.0
    return time, unsure


def _outliers(time: Array) -> NDArray[np.bool_]:
    """Single times far from both neighbours, which themselves follow each other."""
    out = np.zeros(len(time), dtype=bool)
    if len(time) < 3:
        return out
    step = np.abs(np.diff(time))
    far = (step[:-1] > _OUTLIER) & (step[1:] > _OUTLIER)
    out[1:-1] = far & (np.abs(time[2:] - time[:-2]) < _NEAR)
    return out
