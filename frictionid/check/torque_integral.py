"""Mean torques of the windows, also of a torque that comes late or early."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows
from frictionid.data.recordings import Recording
from frictionid.data.signals import Signal

# Recordings lie this far apart on the common clock of `Impulse` [s].
_APART = 10.0
# A line between samples has a quadratic integral: points between them make it piecewise linear.
_FINE = 8


class Impulse(NamedTuple):
    """Integral of the logged torques over all recordings, on one clock.

    clock (S,) [s] ; value (S, n) [N m s] ; shift (R,) [s] from each recording's time to the clock ;
    interval [s] between two samples of the torque
    """

    clock: Array
    value: Array
    shift: Array
    interval: float

    def means(self, rows: Rows, delay: ArrayLike = 0.0) -> Array:
        """Mean over each window of the torque logged `delay` [s] before, (..., K, n) [N m]."""
        late = np.asarray(delay, float)[..., None]
        shift = self.shift[rows.recording]
        start, stop = rows.start + shift - late, rows.stop + shift - late
        n = self.value.shape[1]
        sums = [
            np.interp(stop, self.clock, self.value[:, j])
            - np.interp(start, self.clock, self.value[:, j])
            for j in range(n)
        ]
        out: Array = np.stack(sums, axis=-1) / (rows.stop - rows.start)[:, None]
        return out


def impulse_of(recordings: Sequence[Recording]) -> Impulse:
    """Integrals of the torques, first and last value kept for some seconds outside each recording.

    Examples
    --------
    >>> time = np.array([0.0, 1.0])
    >>> angle = Signal(time, np.zeros((2, 1)))
    >>> held = Signal(time, np.array([[2.0], [4.0]]), "previous")
    >>> impulse = impulse_of([Recording("a", angle, held)])
    >>> at = np.array([0.5, 1.5]) + impulse.shift[0]
    >>> float(np.diff(np.interp(at, impulse.clock, impulse.value[:, 0]))[0].round(9))
    3.0
    """
    clocks, heights, shifts, end = [], [], [], 0.0
    for recording in recordings:
        time, height = _pieces(recording)
        shifts.append(end + _APART - time[0])
        clocks.append(time + shifts[-1])
        heights.append(height)
        end = clocks[-1][-1]
    clock, height = np.concatenate(clocks), np.concatenate(heights)
    steps = height[:-1] * np.diff(clock)[:, None]
    value = np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])
    gaps = [np.median(np.diff(r.torque.time)) for r in recordings if len(r.torque.time) > 1]
    usual = float(np.median(gaps)) if gaps else 0.0
    return Impulse(clock, value, np.array(shifts), usual)


def _pieces(recording: Recording) -> tuple[Array, Array]:
    """Times and the torque from each of them to the next, some seconds wider than the recording."""
    torque, angle = recording.torque, recording.angle.time
    time, value = (torque.time, torque.value) if _holds(torque) else _refined(torque)
    before = min(time[0], angle[0]) - _APART / 3
    behind = max(time[-1], angle[-1]) + _APART / 3
    return (
        np.concatenate([[before], time, [behind]]),
        np.concatenate([value[:1], value, value[-1:]]),
    )


def _holds(torque: Signal) -> bool:
    return torque.hold == "previous"


def _refined(torque: Signal) -> tuple[Array, Array]:
    """A linear signal as pieces whose heights are its means over them."""
    part = np.arange(_FINE) / _FINE
    time, value = torque.time, torque.value
    fine = (time[:-1, None] + np.diff(time)[:, None] * part).ravel()
    middle = part + 0.5 / _FINE
    mean = value[:-1, None] + np.diff(value, axis=0)[:, None] * middle[:, None]
    return np.append(fine, time[-1]), np.concatenate([mean.reshape(-1, value.shape[1]), value[-1:]])
