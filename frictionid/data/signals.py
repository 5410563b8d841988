"""Sampled signals, each on its own clock: values between samples, checks, facts of the clock."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frictionid.errors import InputError, located

Array = NDArray[np.float64]

LARGEST = 1e20  # of what is measured, in SI units: its squares still are numbers
TORQUE_HOLD = "previous"  # of a torque between two samples, where nothing is stated


class Signal(NamedTuple):
    """Samples of one quantity, on their own, possibly uneven, clock.

    Attributes
    ----------
    time : array, shape (T,) [s]
        Strictly increasing.
    value : array, shape (T, n)
        One column per joint, in the SI unit of the quantity.
    hold : str or None
        Between two samples: "linear" interpolates (a sensor's samples of a varying current),
        "previous" keeps the earlier one (a drive that holds its command). None, not stated:
        interpolated, but as the torque of a `Recording` held (`TORQUE_HOLD`).
    sigma : array, shape (n,) or (T, n), or None
        Standard deviation of the noise of each column, or of each sample; None where it is unknown.
    """

    time: Array
    value: Array
    hold: str | None = None
    sigma: Array | None = None

    @property
    def duration(self) -> float:
        """Time [s] from the first sample to the last one."""
        return float(self.time[-1] - self.time[0])


def sample(signal: Signal, time: ArrayLike) -> Array:
    """Values of the signal at the given times, the first and last value kept outside its span.

    Parameters
    ----------
    signal : Signal, T samples of n columns
    time : array, shape (K,) [s], in any order

    Returns
    -------
    array, shape (K, n), in the unit of ``signal.value``

    Examples
    --------
    >>> ramp = Signal(np.array([0.0, 1.0]), np.array([[0.0], [2.0]]))
    >>> sample(ramp, [0.25, 3.0]).ravel()
    array([0.5, 2. ])
    >>> sample(ramp._replace(hold="previous"), [0.25, 3.0]).ravel()
    array([0., 2.])
    """
    clock, value = np.asarray(signal.time, float), np.asarray(signal.value, float)
    time = np.asarray(time, float)
    if holds(signal):
        return value[np.maximum(np.searchsorted(clock, time, side="right") - 1, 0)]
    return np.stack([np.interp(time, clock, column) for column in value.T], axis=-1)


def cut(signal: Signal, start: float, stop: float) -> Signal:
    """Signal with only the samples at start <= time <= stop [s].

    Raises
    ------
    InputError
        Where no sample lies in that span.

    Examples
    --------
    >>> cut(Signal(np.arange(4.0), np.ones((4, 1))), 0.5, 2.0).time
    array([1., 2.])
    """
    time = np.asarray(signal.time, float)
    inside = (time >= start) & (time <= stop)
    if not inside.any():
        span = f"{time[0]:g} to {time[-1]:g} s" if time.size else "nothing"
        raise InputError(
            f"no sample lies between {start:g} and {stop:g} s: the signal spans {span}; "
            "choose a span inside it"
        )
    return taken(signal, inside)


def taken(signal: Signal, rows: ArrayLike) -> Signal:
    """Signal with some of its samples, by a mask (T,) or by increasing indices.

    >>> taken(Signal(np.arange(3.0), np.ones((3, 1))), np.array([0, 2])).time
    array([0., 2.])
    """
    rows = np.asarray(rows)
    time, value = np.asarray(signal.time, float)[rows], np.asarray(signal.value, float)[rows]
    each = signal.sigma is not None and np.ndim(signal.sigma) == 2
    sigma = np.asarray(signal.sigma)[rows] if each else signal.sigma
    return Signal(time, value, signal.hold, sigma)


def relative_noise(signal: Signal) -> Array:
    """Standard deviation of each sample relative to the median of its column, shape (T, n).

    >>> sigma = np.array([[1.0], [1.0], [3.0]])
    >>> relative_noise(Signal(np.arange(3.0), np.zeros((3, 1)), sigma=sigma))
    array([[1.],
           [1.],
           [3.]])
    """
    if signal.sigma is None or np.ndim(signal.sigma) == 1:
        return np.ones_like(np.asarray(signal.value, float))
    sigma = np.asarray(signal.sigma, float)
    return sigma / np.median(sigma, axis=0)


def holds(signal: Signal) -> bool:
    """Whether the earlier sample is kept between two samples, hold = "previous"."""
    if signal.hold not in (None, "linear", "previous"):
        raise InputError(f'hold must be "linear" or "previous", not {signal.hold!r}')
    return signal.hold == "previous"


def first_fault(
    time: ArrayLike, value: ArrayLike, names: tuple[str, ...]
) -> tuple[int, str] | None:
    """Index of the first invalid sample and the reason, or None.

    Parameters
    ----------
    time : array, shape (T,) [s]
    value : array, shape (T, n)
    names : tuple of n + 1 names, the time's first, for the reason

    Examples
    --------
    >>> first_fault([0.0, 1.0, 1.0], [[5.0], [6.0], [7.0]], ("t", "q"))
    (2, "time must increase: 't' is 1 after 1")
    """
    cells = np.column_stack([np.asarray(time, float), np.asarray(value, float)])
    with np.errstate(invalid="ignore"):
        broken = ~(np.abs(cells) < LARGEST)
    back = np.zeros(len(cells), dtype=bool)
    back[1:] = cells[1:, 0] <= cells[:-1, 0]
    faulty = broken.any(axis=1) | back
    if not faulty.any():
        return None
    at = int(np.argmax(faulty))
    if broken[at].any():
        column = int(np.argmax(broken[at]))
        number = "empty or nan" if np.isnan(cells[at, column]) else str(cells[at, column])
        if np.isfinite(cells[at, column]):
            return at, f"{names[column]!r} is {number}, which no sensor reports"
        return at, f"{names[column]!r} is {number}; every value must be a finite number"
    return (
        at,
        f"time must increase: {names[0]!r} is {cells[at, 0]:.9g} after {cells[at - 1, 0]:.9g}",
    )


def check_signal(where: str, signal: Signal) -> None:
    """Check the shapes of a signal, its hold, its deviations, and that all is finite and in order.

    Raises
    ------
    InputError
        Saying `where` the first fault is.
    """
    if not isinstance(signal, Signal):
        raise InputError(f"{where}: it must be a Signal(time, value), not {signal!r:.60}")
    time, value = np.asarray(signal.time), np.asarray(signal.value)
    if time.ndim != 1 or value.ndim != 2 or len(time) != len(value) or value.size == 0:
        raise InputError(
            f"{where}: time must have shape (T,) and value (T, n) with T, n > 0, "
            f"not {time.shape} and {value.shape}"
        )
    with located(where):
        holds(signal)
    fault = first_fault(time, value, ("time", *(f"column {k}" for k in range(value.shape[1]))))
    if fault:
        raise InputError(f"{where}, sample {fault[0]} (the first is 0): {fault[1]}")
    if signal.sigma is None:
        return
    sigma, shape = np.asarray(signal.sigma, float), value.shape
    if sigma.shape not in (shape, shape[1:]):
        raise InputError(
            f"{where}: sigma must have one entry per column, shape {shape[1:]}, or per sample, "
            f"shape {shape}, not {sigma.shape}"
        )
    wrong = ~(np.isfinite(sigma) & (sigma > 0))
    if wrong.any():
        at = f", sample {np.argwhere(wrong)[0][0]} (the first is 0)" if sigma.ndim == 2 else ""
        raise InputError(f"{where}{at}: sigma must be positive and finite, not {sigma[wrong][0]:g}")


# A torque may begin late or end early by some of its own gaps, or by this share of the motion; the
# checks find a clock that is off by less.
_GAPS, _SHARE = 5.0, 0.2


def check_clocks(where: str, angle: Signal, torque: Signal) -> None:
    """Check that the torque covers the motion; it is not extrapolated.

    A held torque may be logged only where it changes: its own gaps are the measure.

    Raises
    ------
    InputError
        Where they share no moment, or too much torque is missing.
    """
    late = torque.time[0] > angle.time[-1]
    early = torque.hold == "linear" and torque.time[-1] < angle.time[0]
    if late or early:
        raise InputError(
            f"{where}: torque ({torque.time[0]:g} to {torque.time[-1]:g} s) and angle "
            f"({angle.time[0]:g} to {angle.time[-1]:g} s) share no moment; both clocks must count "
            "from the same instant"
        )
    if len(torque.time) < 2 or not np.any(torque.value):
        return
    usual = np.max(np.diff(torque.time)) + np.median(np.diff(angle.time))
    slack = max(_GAPS * usual, _SHARE * angle.duration)
    check_span(f"{where}: torque is", torque, angle, slack)


def check_span(what: str, signal: Signal, angle: Signal, slack: float) -> None:
    """Check that a signal begins at most `slack` [s] after the angles, and ends as little before.

    Raises
    ------
    InputError
        Saying `what` begins too late or ends too early.
    """
    begin, end = signal.time[[0, -1]] - angle.time[0]  # as start and stop count
    if max(begin, angle.duration - end) > slack:
        raise InputError(
            f"{what} known from {begin:g} to {end:g} s only, the angles from 0 to "
            f"{angle.duration:g} s: keep the common span by start and stop in [recordings]"
        )


def column_count(signal: Signal) -> int:
    """Number of columns of a signal."""
    return int(np.shape(signal.value)[1])


# --- Facts of the clock of the angles -------------------------------------------------------------

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
    from scipy.ndimage import median_filter  # which most that reads signals does without

    near = median_filter(intervals, NEAR_INTERVALS, mode="mirror")
    ratio = near / whole
    return np.where((ratio > 1.4) | (ratio < 1 / 1.4), near, whole)


def run_edges(flags: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First samples of the runs of true flags (T,), and the samples behind them.

    >>> [edge.tolist() for edge in run_edges(np.array([True, True, False, True]))]
    [[0, 3], [2, 4]]
    """
    edges = np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0))
    return edges[::2], edges[1::2]
