"""Clocks by a marker that both see: a lamp in the picture whose switch the drive logs, too.

Every edge of the lamp lies between two frames and between two rows of the log; edges are matched by
the pattern of their distances, and a line through them is offset and drift.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.acquire.align.drifting import QUARTZ
from frictionid.arrays import Array
from frictionid.errors import InputError

_REACH = 1.96


class Edges(NamedTuple):
    """Edges of a marker: middle (E,) and half-width (E,) [s] of when, and whether it rises."""

    time: Array
    half: Array
    rises: Array


class Marked(NamedTuple):
    """Clocks by a marker: angles' time = log's time + offset + drift (log's time - at).

    error, drift_error : standard deviations; edges : number that were matched
    """

    offset: float
    drift: float
    at: float
    error: float
    drift_error: float
    edges: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the offset [s]."""
        return self.offset - _REACH * self.error, self.offset + _REACH * self.error


def edges_of(time: Array, value: Array, where: str) -> Edges:
    """Edges of a marker that is on or off, a brightness or a number.

    Raises
    ------
    InputError
        Where it never changes.

    Examples
    --------
    >>> edges_of(np.arange(4.0), np.array([0.0, 9.0, 9.0, 1.0]), "led").time
    array([0.5, 2.5])
    """
    low, high = np.quantile(value, [0.02, 0.98])
    if not high > low:
        low, high = float(value.min()), float(value.max())
    if not high > low:
        raise InputError(f"{where}: the marker never changes; leave --marker out")
    on = value > (low + high) / 2
    at = np.flatnonzero(on[1:] != on[:-1])
    if not len(at):
        raise InputError(f"{where}: the marker never changes; leave --marker out")
    return Edges((time[at] + time[at + 1]) / 2, (time[at + 1] - time[at]) / 2, on[at + 1])


def marked(seen: Edges, logged: Edges) -> Marked:
    """Clocks from the edges that the camera saw and that the drive logged.

    Raises
    ------
    InputError
        Where the patterns of both do not agree.
    """
    pairs = _matched(seen, logged)
    most = min(len(seen.time), len(logged.time))
    if len(pairs) < max(1, (most + 1) // 2):
        raise InputError(
            f"the marker's edges do not agree: the camera saw {len(seen.time)}, the log has "
            f"{len(logged.time)}, and {len(pairs)} fit each other; leave --marker out"
        )
    i, k = np.array(pairs).T
    tau, late = logged.time[k], seen.time[i] - logged.time[k]
    at = float(tau.mean())
    # each edge lies anywhere in its two gaps
    sigma = np.sqrt((seen.half[i] ** 2 + logged.half[k] ** 2) / 3.0)
    A = np.stack([np.ones(len(tau)), tau - at], axis=1) / sigma[:, None]
    H = A.T @ A + np.diag([0.0, 1.0 / QUARTZ**2])
    offset, slope = np.linalg.solve(H, A.T @ (late / sigma))
    errors = np.sqrt(np.diag(np.linalg.inv(H)))
    return Marked(float(offset), float(slope), at, float(errors[0]), float(errors[1]), len(pairs))


def _matched(seen: Edges, logged: Edges) -> list[tuple[int, int]]:
    """Pairs (edge seen, edge logged) of the offset under which most edges fit."""
    best: list[tuple[int, int]] = []
    worst = np.inf
    for i in range(len(seen.time)):
        for k in range(len(logged.time)):
            if seen.rises[i] == logged.rises[k]:
                pairs, off = _pairs(seen, logged, float(seen.time[i] - logged.time[k]))
                if len(pairs) > len(best) or (len(pairs) == len(best) and off < worst):
                    best, worst = pairs, off
    return best


def _pairs(seen: Edges, logged: Edges, offset: float) -> tuple[list[tuple[int, int]], float]:
    out: list[tuple[int, int]] = []
    off = 0.0
    for i, (time, half, rises) in enumerate(zip(*seen, strict=True)):
        k = int(np.argmin(np.abs(logged.time + offset - time)))
        apart = abs(float(logged.time[k] + offset - time))
        # twice, because the offset itself is that of two edges; and what clocks may drift
        allowed = 2 * (half + logged.half[k]) + QUARTZ * abs(time - seen.time[0])
        if apart <= allowed and logged.rises[k] == rises and (not out or out[-1][1] < k):
            out.append((i, k))
            off += apart
    return out, off
