"""Clocks by a marker that both see: a lamp in the picture whose switch the drive logs, too.

Every edge of the lamp lies between two frames, or within the exposure of one that is lit in part,
and between two rows of the log; edges are matched by the pattern of their distances, and a line
through them is offset and drift.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.acquire.align.drifting import QUARTZ
from frictionid.arrays import Array
from frictionid.errors import InputError

_REACH = 1.96
_NEAR = 0.25  # of the way between dark and lit: such a brightness is one or the other
_CLEAR = 5.0  # deviations of the noise that dark and lit must lie apart, and
_FAINT = 0.02  # the least share of the brighter one
_ROUGHLY = 0.5  # [s] to which an offset is known
_CANDIDATES = 2000  # offsets that are looked at closely
_AGAIN = 0.6  # of the edges that fit best: where as many fit elsewhere, nothing is sure


class Edges(NamedTuple):
    """Edges of a marker: middle (E,) and half-width (E,) [s] of when, and whether it rises.

    span : (2,) [s], from when to when it was watched
    """

    time: Array
    half: Array
    rises: Array
    span: tuple[float, float]


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


def edges_of(time: Array, value: Array, where: str, exposure: float = 0.0) -> Edges:
    """Edges of a marker that is on or off, a brightness or a number.

    exposure : of the frames [s], where it is known: of a frame that is neither dark nor lit it
        tells how near its middle the edge lies

    Raises
    ------
    InputError
        Where it never changes between two levels.

    Examples
    --------
    >>> edges_of(np.arange(4.0), np.array([0.0, 9.0, 9.0, 1.0]), "led").time
    array([0.5, 2.5])
    """
    levels = _levels(value)
    if levels is None:
        low, high = float(value.min()), float(value.max())
        raise InputError(
            f"{where}: the marker never changes from one level to another (all is within {low:.4g} "
            f"to {high:.4g}); correct the lamp's place, or leave --marker out"
        )
    low, high, noise = levels
    way = (value - low) / (high - low)
    sure = np.flatnonzero((way < _NEAR) | (way > 1 - _NEAR))
    on = way[sure] > 0.5
    turn = np.flatnonzero(on[1:] != on[:-1])
    a, b = sure[turn], sure[turn + 1]
    middle, half = (time[a] + time[b]) / 2, (time[b] - time[a]) / 2
    part = (b - a == 2) & (4 * noise < _NEAR * (high - low))  # one frame that is lit in part
    gap = np.minimum(time[a + 1] - time[a], time[b] - time[b - 1])
    middle = np.where(part, time[a + 1], middle)
    half = np.where(part, np.minimum(exposure or np.inf, gap) / 2, half)
    return Edges(middle, half, on[turn + 1], (float(time[0]), float(time[-1])))


def _levels(value: Array) -> tuple[float, float, float] | None:
    """Dark, lit and noise of a brightness, None where it does not have two levels."""
    for rare in (0.02, 0.0):  # a lamp that is hardly ever lit, or dark
        split = float(np.quantile(value, [rare, 1 - rare]).mean())
        groups = value[value <= split], value[value > split]
        if not all(len(g) for g in groups):
            continue
        low, high = (float(np.median(g)) for g in groups)
        noise = max(1.48 * float(np.median(np.abs(g - np.median(g)))) for g in groups)
        if high - low > max(_CLEAR * noise, _FAINT * max(abs(low), abs(high))):
            return low, high, noise
    return None


class _Fit(NamedTuple):
    """Pairs (P, 2) of edges seen and logged that fit with an offset [s].

    missing : edges that only one has seen, though both watched; off : [s], sum of the distances
    """

    pairs: Array
    offset: float
    missing: int
    off: float


def marked(seen: Edges, logged: Edges, roughly: float | None = None) -> Marked:
    """Clocks from the edges that the camera saw and that the drive logged.

    roughly : the offset to within 0.5 s, where it is known

    Raises
    ------
    InputError
        Where the patterns of both do not agree, or agree with several offsets.
    """
    fits = _fits(seen, logged, roughly)
    best = max(fits, key=lambda f: (len(f.pairs), -f.off), default=None)
    pairs = np.zeros((0, 2), dtype=int) if best is None else best.pairs
    most = min(len(seen.time), len(logged.time))
    if len(pairs) < max(1, (most + 1) // 2):
        raise InputError(
            f"the marker's edges do not agree: the camera saw {len(seen.time)}, the log has "
            f"{len(logged.time)}, and {len(pairs)} fit each other; leave --marker out"
        )
    assert best is not None
    _check_alone(best, fits, _width(seen, logged))
    i, k = pairs.T
    tau, late = logged.time[k], seen.time[i] - logged.time[k]
    at = float(tau.mean())
    # each edge lies anywhere in its two gaps
    sigma = np.sqrt((seen.half[i] ** 2 + logged.half[k] ** 2) / 3.0)
    A = np.stack([np.ones(len(tau)), tau - at], axis=1) / sigma[:, None]
    H = A.T @ A + np.diag([0.0, 1.0 / QUARTZ**2])
    offset, slope = np.linalg.solve(H, A.T @ (late / sigma))
    errors = np.sqrt(np.diag(np.linalg.inv(H)))
    return Marked(float(offset), float(slope), at, float(errors[0]), float(errors[1]), len(pairs))


def _width(seen: Edges, logged: Edges) -> float:
    """Offsets [s] that are nearer to each other may be the same."""
    reach = 4 * float(np.median(seen.half) + np.median(logged.half))
    return reach + QUARTZ * float(np.ptp(seen.span))


def _fits(seen: Edges, logged: Edges, roughly: float | None) -> list[_Fit]:
    """What fits under the offsets round which most edges lie."""
    late = seen.time[:, None] - logged.time
    # an edge in a gap of the frames or the log tells no offset
    known = [e.half <= 2 * np.median(e.half) for e in (seen, logged)]
    like = (seen.rises[:, None] == logged.rises) & known[0][:, None] & known[1]
    if roughly is not None:
        like &= np.abs(late - roughly) <= _ROUGHLY
    i, k = np.nonzero(like)
    width = _width(seen, logged)
    order = np.sort(late[i, k])
    crowd = np.searchsorted(order, late[i, k] + width) - np.searchsorted(order, late[i, k] - width)
    first = np.argsort(-crowd, kind="stable")[:_CANDIDATES]
    return [_fit(seen, logged, int(i[j]), int(k[j])) for j in first]


def _check_alone(best: _Fit, fits: list[_Fit], width: float) -> None:
    for other in fits:
        if (
            abs(other.offset - best.offset) > width
            and len(other.pairs) > _AGAIN * len(best.pairs)
            and other.missing <= best.missing + 0.1 * len(other.pairs)
        ):
            raise InputError(
                f"the marker fits with an offset of {other.offset:.3f} s as well as with "
                f"{best.offset:.3f} s: switch the lamp at uneven times and more often, or tell "
                "--offset to within 0.5 s"
            )


def _fit(seen: Edges, logged: Edges, i: int, k: int) -> _Fit:
    """What fits under the offset by which two edges are one."""
    offset = float(seen.time[i] - logged.time[k])
    there = logged.time + offset
    near = np.asarray(np.searchsorted((there[1:] + there[:-1]) / 2, seen.time), dtype=int)
    apart = np.abs(there[near] - seen.time)
    # the offset itself is that of two edges; and what clocks may drift
    allowed = seen.half + logged.half[near] + (seen.half[i] + logged.half[k])
    allowed = allowed + QUARTZ * np.abs(seen.time - seen.time[i])
    fits = np.flatnonzero((apart <= allowed) & (logged.rises[near] == seen.rises))
    _, once = np.unique(near[fits], return_index=True)
    fits = fits[once]
    pairs = np.stack([fits, near[fits]], axis=1)
    start, stop = logged.span[0] + offset, logged.span[1] + offset
    both = int(((seen.time > start) & (seen.time < stop)).sum())
    both += int(((there > seen.span[0]) & (there < seen.span[1])).sum())
    return _Fit(pairs, offset, max(both - 2 * len(pairs), 0), float(apart[fits].sum()))
