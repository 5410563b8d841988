"""Checks of signals when a recording is made: shapes, values, noise and clocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from frictionid.data.signals import Array, Signal
from frictionid.errors import InputError

LARGEST = 1e20  # of what is measured, in SI units: its squares still are numbers


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
    if signal.sigma is not None:
        _check_sigma(where, np.asarray(signal.sigma, float), value.shape)


def _check_sigma(where: str, sigma: Array, shape: tuple[int, ...]) -> None:
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
    missing = max(torque.time[0] - angle.time[0], angle.time[-1] - torque.time[-1])
    if missing > max(_GAPS * usual, _SHARE * (angle.time[-1] - angle.time[0])):
        raise InputError(
            f"{where}: torque is known from {torque.time[0]:g} to {torque.time[-1]:g} s only, the "
            f"angles from {angle.time[0]:g} to {angle.time[-1]:g} s: keep the common span by start "
            "and stop in [recordings]"
        )


def column_count(signal: Signal) -> int:
    """Number of columns of a signal."""
    return int(np.shape(signal.value)[1])
