"""Exact integrals of sampled signals between any two times: averages, delayed means, moments."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from frictionid.arrays import Array
from frictionid.errors import InputError

from .signals import Signal, holds


class SignalIntegrals(NamedTuple):
    """Running integrals of the signals of R recordings, T samples of n columns end to end.

    begin (R,) [s] time of each first sample; first, last (R,) index of each first and last sample;
    apart [s] between two recordings in `key` (T,), which orders all samples; clock (T,) [s] since
    each recording's first sample; value (T, n) and its slope rise (T, n) towards the next sample;
    area and area2 (T, n), the integral of the value since the first sample, and its integral.
    """

    begin: Array
    first: NDArray[np.int_]
    last: NDArray[np.int_]
    apart: float
    key: Array
    clock: Array
    value: Array
    rise: Array
    area: Array
    area2: Array

    def mapped(self, matrix: Array) -> "SignalIntegrals":
        """Integrals of the signals after a linear map (n, n) of their columns."""
        value, rise, area, area2 = (x @ matrix.T for x in self[-4:])
        return self._replace(value=value, rise=rise, area=area, area2=area2)


class Pieces(NamedTuple):
    """A torque in m pieces of time of k intervals, (m, k, n) each.

    mean [N m]; moment [N m s^2], by which a body of unit inertia gets further in a piece than the
    mean alone would bring it, integral of (u - mean)(end - t) dt; and the derivatives of both by
    the delay.
    """

    mean: Array
    moment: Array
    mean_later: Array
    moment_later: Array


def integrals_of(signals: Sequence[Signal]) -> SignalIntegrals:
    """Integrals of one signal per recording, held or joined by lines as they were logged."""
    sizes = [len(s.time) for s in signals]
    last = np.cumsum(sizes) - 1
    first = last + 1 - np.array(sizes)
    apart = 2.0 * max(s.duration for s in signals) + 1.0
    parts = []
    for r, signal in enumerate(signals):
        clock = np.asarray(signal.time, float) - signal.time[0]
        dt = np.diff(clock)[:, None]
        value = np.asarray(signal.value, dtype=float)
        rise = np.zeros_like(value)
        if not holds(signal):
            rise[:-1] = np.diff(value, axis=0) / dt
        area, area2 = np.zeros((2, *value.shape))
        area[1:] = np.cumsum((value[:-1] + rise[:-1] * dt / 2) * dt, axis=0)
        inner = (area[:-1] + (value[:-1] / 2 + rise[:-1] * dt / 6) * dt) * dt
        area2[1:] = np.cumsum(inner, axis=0)
        parts.append((clock + r * apart, clock, value, rise, area, area2))
    begin = np.array([s.time[0] for s in signals], float)
    return SignalIntegrals(
        begin, first, last, apart, *map(np.concatenate, zip(*parts, strict=True))
    )


def averages(signal: Signal, edges: ArrayLike) -> Array:
    """Exact means of the signal over the intervals between neighbouring edges.

    The mean over [a, b] is (F(b) - F(a)) / (b - a) with the integral F of the held or linearly
    interpolated samples, so that a resampled torque does the same impulse as the recorded one.
    Outside the signal's span its first and last value are kept.

    Parameters
    ----------
    signal : Signal, T samples of n columns
    edges : array, shape (K+1,) [s], strictly increasing

    Returns
    -------
    array, shape (K, n), in the unit of ``signal.value``

    Raises
    ------
    InputError
        Where an edge does not lie after the one before it.

    Examples
    --------
    >>> ramp = Signal(np.array([0.0, 1.0]), np.array([[0.0], [2.0]]))
    >>> averages(ramp, [0.0, 0.5, 1.0]).ravel()
    array([0.5, 1.5])
    """
    edges = np.asarray(edges, float)
    width = np.diff(edges)
    if not np.all(width > 0):
        at = int(np.argmax(~(width > 0)))
        raise InputError(
            f"edges of averages must increase: edge {at + 1} is {edges[at + 1]:g} s after "
            f"{edges[at]:g} s; sort them and drop repeated ones"
        )
    # Integrating the difference from the first value keeps a constant signal exactly constant.
    value = np.asarray(signal.value, float)
    log = integrals_of([signal._replace(value=value - value[0])])
    return value[0] + window_means(log, np.zeros(len(width), dtype=int), edges[:-1], edges[1:])


def window_means(
    log: SignalIntegrals, recording: Array, start: Array, stop: Array, delay: ArrayLike = 0.0
) -> Array:
    """Means over K windows of the signal logged `delay` [s] before, shape (..., K, n).

    recording, start, stop (K,): window k lasts from start[k] to stop[k] [s] of recording[k];
    delay (...) [s].

    >>> log = integrals_of([Signal(np.arange(3.0), np.array([[0.0], [2.0], [4.0]]), "previous")])
    >>> window_means(log, np.array([0]), np.array([1.0]), np.array([2.0]), [0.0, 0.5]).ravel()
    array([2., 1.])
    """
    late = np.asarray(delay, float)
    edges = np.stack([start, stop], axis=1)[..., None] - late.ravel()
    index, d, beyond = _place(log, recording, edges.reshape(len(start), 2 * late.size))
    v, rise, area = (x.take(index, axis=0) for x in (log.value, log.rise, log.area))
    area = area + (v + rise * d / 2) * d
    area = area + (v + rise * d) * beyond if beyond.any() else area
    change = np.diff(area.reshape(*edges.shape, area.shape[-1]), axis=1)[:, 0]  # (K, delays, n)
    mean = np.moveaxis(change / (stop - start)[:, None, None], 1, 0)
    return mean.reshape(*late.shape, *mean.shape[1:])


def moving_average(signal: Signal, width: float) -> Signal:
    """Means over a width [s] about each sample, joined by lines.

    >>> step = Signal(np.arange(5.0), np.array([[0.0], [0.0], [0.0], [2.0], [2.0]]), "previous")
    >>> moving_average(step, 2.0).value.ravel()
    array([0., 0., 0., 1., 2.])
    """
    every, half = np.zeros(len(signal.time), dtype=int), width / 2
    start, stop = signal.time - half, signal.time + half
    value = window_means(integrals_of([signal]), every, start, stop)
    return Signal(signal.time, value, "linear")


def pieces_of(log: SignalIntegrals, recording: Array, edges: Array) -> Pieces:
    """Torque of recordings (k,) between edges (k, m + 1) [s] of the time it was logged at.

    The first and the last value are kept beyond a log's ends.

    >>> log = integrals_of([Signal(np.arange(3.0), np.array([[0.0], [2.0], [2.0]]), "previous")])
    >>> pieces = pieces_of(log, np.array([0]), np.array([[0.0, 2.0, 5.0]]))
    >>> pieces.mean.ravel(), pieces.moment.ravel()
    (array([1., 2.]), array([-1.,  0.]))
    """
    value, area, area2 = _at(log, recording, edges)
    width = np.diff(edges, axis=1)[..., None]
    mean = np.diff(area, axis=1) / width
    change = np.diff(value, axis=1)
    moment = np.diff(area2, axis=1) - width * (area[:, :-1] + area[:, 1:]) / 2
    later = width * ((value[:, :-1] + value[:, 1:]) / 2 - mean)
    out = (mean, moment, -change / width, later)
    return Pieces(*(np.ascontiguousarray(np.moveaxis(x, 1, 0)) for x in out))


def _at(log: SignalIntegrals, recording: Array, time: Array) -> tuple[Array, Array, Array]:
    """Value, area and area2 (k, m, n) at times (k, m) of recordings (k,)."""
    index, d, beyond = _place(log, recording, time)
    v, rise, area, area2 = (x.take(index, axis=0) for x in log[-4:])
    value = v + rise * d
    area2 = area2 + (area + (v / 2 + rise * d / 6) * d) * d
    area = area + (v + rise * d / 2) * d
    if beyond.any():
        area2 = area2 + (area + value * beyond / 2) * beyond
        area = area + value * beyond
    return value, area, area2


def _place(
    log: SignalIntegrals, recording: Array, time: Array
) -> tuple[NDArray[np.intp], Array, Array]:
    """Sample (k, m) before each time, and times (k, m, 1) since then and beyond the log's ends."""
    local = time - log.begin[recording][:, None]
    inside = np.clip(local, 0.0, log.clock[log.last][recording][:, None])
    key = inside + log.apart * recording[:, None]
    index = np.searchsorted(log.key, key.ravel(), side="right").reshape(key.shape) - 1
    index = np.maximum(index, log.first[recording][:, None])
    return index, (inside - log.clock[index])[..., None], (local - inside)[..., None]
