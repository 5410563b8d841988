"""Sampled signals, each on its own clock: their values between samples, and checks of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frictionid.errors import InputError

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
    time, value = np.asarray(signal.time), np.asarray(signal.value)
    if time.ndim != 1 or value.ndim != 2 or len(time) != len(value) or value.size == 0:
        raise InputError(
            f"{where}: time must have shape (T,) and value (T, n) with T, n > 0, "
            f"not {time.shape} and {value.shape}"
        )
    if signal.hold not in (None, "linear", "previous"):
        raise InputError(f'{where}: hold must be "linear" or "previous", not {signal.hold!r}')
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
    if max(signal.time[0] - angle.time[0], angle.time[-1] - signal.time[-1]) > slack:
        raise InputError(
            f"{what} known from {signal.time[0]:g} to {signal.time[-1]:g} s only, the angles from "
            f"{angle.time[0]:g} to {angle.time[-1]:g} s: keep the common span by start and stop in "
            "[recordings]"
        )


def column_count(signal: Signal) -> int:
    """Number of columns of a signal."""
    return int(np.shape(signal.value)[1])
