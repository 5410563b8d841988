"""Logged torque of all recordings as one series: its effect over pieces of time, at any delay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.signals import Signal


class Series(NamedTuple):
    """T samples of all recordings: clock (T,) [s] since each one's first, first (R,) of them.

    key (T,) orders all samples; value (T, n), and rise (T, n) towards the next sample; area and
    area2 (T, n), the integral of the value since the first sample, and the integral of that.
    """

    begin: Array
    first: Array
    last: Array
    apart: float
    key: Array
    clock: Array
    value: Array
    rise: Array
    area: Array
    area2: Array


class Pieces(NamedTuple):
    """Torque in m pieces of time of k intervals, (m, k, n) each.

    mean [N m]; moment [N m s^2], by which a body of unit inertia gets further in a piece than the
    mean alone would bring it, integral of (u - mean)(end - t) dt; and the derivatives of both by
    the delay.
    """

    mean: Array
    moment: Array
    mean_later: Array
    moment_later: Array


def series_of(torques: Sequence[Signal]) -> Series:
    """Series of some recordings' torques, held or joined by lines as they were logged."""
    sizes = [len(s.time) for s in torques]
    last = np.cumsum(sizes) - 1
    first = last + 1 - np.array(sizes)
    apart = 2.0 * max(float(s.time[-1] - s.time[0]) for s in torques) + 1.0
    parts = []
    for r, signal in enumerate(torques):
        clock = signal.time - signal.time[0]
        dt = np.diff(clock)[:, None]
        value = np.asarray(signal.value, dtype=float)
        rise = np.zeros_like(value)
        if signal.hold == "linear" and len(dt):
            rise[:-1] = np.diff(value, axis=0) / dt
        area, area2 = np.zeros((2, *value.shape))
        area[1:] = np.cumsum((value[:-1] + rise[:-1] * dt / 2) * dt, axis=0)
        inner = (area[:-1] + (value[:-1] / 2 + rise[:-1] * dt / 6) * dt) * dt
        area2[1:] = np.cumsum(inner, axis=0)
        parts.append((clock + r * apart, clock, value, rise, area, area2))
    begin = np.array([s.time[0] for s in torques])
    return Series(begin, first, last, apart, *map(np.concatenate, zip(*parts, strict=True)))


def pieces_of(series: Series, recording: Array, edges: Array) -> Pieces:
    """Torque of recordings (k,) between edges (k, m + 1) [s] of the time it was logged at.

    The first and the last value are kept beyond a log's ends.

    >>> log = series_of([Signal(np.arange(3.0), np.array([[0.0], [2.0], [2.0]]), "previous")])
    >>> found = pieces_of(log, np.array([0]), np.array([[0.0, 2.0, 5.0]]))
    >>> found.mean.ravel(), found.moment.ravel()
    (array([1., 2.]), array([-1.,  0.]))
    """
    value, area, area2 = _at(series, recording, edges)
    width = np.diff(edges, axis=1)[..., None]
    mean = np.diff(area, axis=1) / width
    change = np.diff(value, axis=1)
    moment = np.diff(area2, axis=1) - width * (area[:, :-1] + area[:, 1:]) / 2
    later = width * ((value[:, :-1] + value[:, 1:]) / 2 - mean)
    out = (mean, moment, -change / width, later)
    return Pieces(*(np.ascontiguousarray(np.moveaxis(x, 1, 0)) for x in out))


def _at(series: Series, recording: Array, time: Array) -> tuple[Array, Array, Array]:
    """Value, area and area2 (k, m, n) at times (k, m) of recordings (k,)."""
    local = time - series.begin[recording][:, None]
    inside = np.clip(local, 0.0, series.clock[series.last][recording][:, None])
    key = inside + series.apart * recording[:, None]
    index = np.searchsorted(series.key, key.ravel(), side="right").reshape(key.shape) - 1
    index = np.maximum(index, series.first[recording][:, None])
    d = (inside - series.clock[index])[..., None]
    v, rise, area, area2 = (x[index] for x in series[-4:])
    value = v + rise * d
    area2 = area2 + (area + (v / 2 + rise * d / 6) * d) * d
    area = area + (v + rise * d / 2) * d
    beyond = (local - inside)[..., None]
    if beyond.any():
        area2 = area2 + (area + value * beyond / 2) * beyond
        area = area + value * beyond
    return value, area, area2
