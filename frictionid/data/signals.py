"""Sampled signals, each on its own clock, and their values between the samples."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frictionid.errors import InputError

Array = NDArray[np.float64]

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
    return np.asarray(sigma / np.median(sigma, axis=0))


def holds(signal: Signal) -> bool:
    """Whether the earlier sample is kept between two samples, hold = "previous"."""
    if signal.hold not in (None, "linear", "previous"):
        raise InputError(f'hold must be "linear" or "previous", not {signal.hold!r}')
    return signal.hold == "previous"
