"""Clocks tied by edges that both sides record: an LED in the picture whose switch the drive logs.

Each edge lies between two frames, or within the exposure of a frame that is lit in part, and
between two rows of the log. Edges are matched by the pattern of their intervals; a line through the
matched pairs gives offset and drift.
"""

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError

from .drifting import DRIFT_SIGMA

_CLOSE = 0.25  # of the distance between dark and lit: such a brightness is one or the other
_CLEAR = 5.0  # standard deviations of the noise that dark and lit must lie apart, and
_FAINT = 0.02  # the least share of the brighter one
_ROUGHLY = 0.5  # [s] to which a given offset holds
_CANDIDATES = 2000  # offsets that are examined
_RIVAL = 0.6  # share of the best number of pairs at which another offset is as good


class Edges(NamedTuple):
    """Edges of a signal with two levels.

    Attributes
    ----------
    time, half : arrays, shape (E,) [s], middle and half-width of the interval of each edge
    rises : array of bool, shape (E,)
    span : first and last time [s] at which the signal was recorded
    """

    time: Array
    half: Array
    rises: Array
    span: tuple[float, float]


class MarkerClock(NamedTuple):
    """Clocks by edges: angles' time = log's time + offset + drift (log's time - at).

    Attributes
    ----------
    offset, at : [s]; drift : [1]
    error, drift_error : standard deviations
    edges : number of matched pairs
    """

    offset: float
    drift: float
    at: float
    error: float
    drift_error: float
    edges: int


def edges_of(time: Array, value: Array, where: str, exposure: float = 0.0) -> Edges:
    """Edges of a brightness or state (T,) that has two levels.

    exposure : of the frames [s], where it is known. The edge of a frame that is lit in part lies
        within it; else within half the distance to the next frames.

    Raises
    ------
    InputError
        Where the signal never changes between two levels; `where` names its file.

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
            f"to {high:.4g}); correct the place of the sync LED, or leave --marker out"
        )
    low, high, noise = levels
    share = (value - low) / (high - low)
    clear = np.flatnonzero((share < _CLOSE) | (share > 1 - _CLOSE))
    on = share[clear] > 0.5
    turn = np.flatnonzero(on[1:] != on[:-1])
    a, b = clear[turn], clear[turn + 1]
    middle, half = (time[a] + time[b]) / 2, (time[b] - time[a]) / 2
    partly = (b - a == 2) & (4 * noise < _CLOSE * (high - low))  # one frame lit in part
    gap = np.minimum(time[a + 1] - time[a], time[b] - time[b - 1])
    middle = np.where(partly, time[a + 1], middle)
    half = np.where(partly, np.minimum(exposure or np.inf, gap) / 2, half)
    return Edges(middle, half, on[turn + 1], (float(time[0]), float(time[-1])))


def _levels(value: Array) -> tuple[float, float, float] | None:
    """Low level, high level and noise of a signal, None where it does not have two levels."""
    for rare in (0.02, 0.0):  # the second for an LED that is hardly ever lit, or dark
        split = float(np.quantile(value, [rare, 1 - rare]).mean())
        groups = value[value <= split], value[value > split]
        if not all(len(g) for g in groups):
            continue
        low, high = (float(np.median(g)) for g in groups)
        noise = max(1.48 * float(np.median(np.abs(g - np.median(g)))) for g in groups)
        if high - low > max(_CLEAR * noise, _FAINT * max(abs(low), abs(high))):
            return low, high, noise
    return None


class _Match(NamedTuple):
    """Edges matched at an offset [s].

    pairs (P, 2) : indices of edges seen and logged; missing : edges that only one side has, though
    both recorded; distance : [s], sum over the pairs
    """

    pairs: Array
    offset: float
    missing: int
    distance: float


def clock_from_edges(seen: Edges, logged: Edges, roughly: float | None = None) -> MarkerClock:
    """Clocks from the edges that the camera saw and that the drive logged.

    Weighted least squares of  seen - logged = offset + drift (logged - at),  with the variance of
    edges anywhere in their intervals and a prior on the drift.

    roughly : the offset to within 0.5 s, where it is known

    Raises
    ------
    InputError
        Where the patterns of both do not agree, or agree with several offsets.
    """
    matches = _matches(seen, logged, roughly)
    best = max(matches, key=lambda m: (len(m.pairs), -m.distance), default=None)
    matched = 0 if best is None else len(best.pairs)
    if best is None or matched < max(1, (min(len(seen.time), len(logged.time)) + 1) // 2):
        raise InputError(
            f"the marker's edges do not agree: the camera saw {len(seen.time)}, the log has "
            f"{len(logged.time)}, and {matched} fit each other; leave --marker out"
        )
    width = _resolution(seen, logged)
    for other in matches:
        if (
            abs(other.offset - best.offset) > width
            and len(other.pairs) > _RIVAL * matched
            and other.missing <= best.missing + 0.1 * len(other.pairs)
        ):
            raise InputError(
                f"the marker fits with an offset of {other.offset:.3f} s as well as with "
                f"{best.offset:.3f} s: switch the LED at uneven times and more often, or give "
                "--offset to within 0.5 s"
            )
    i, k = best.pairs.T
    tau, late = logged.time[k], seen.time[i] - logged.time[k]
    at = float(tau.mean())
    sigma = np.sqrt((seen.half[i] ** 2 + logged.half[k] ** 2) / 3.0)
    A = np.stack([np.ones(len(tau)), tau - at], axis=1) / sigma[:, None]
    H = A.T @ A + np.diag([0.0, 1.0 / DRIFT_SIGMA**2])
    offset, drift = np.linalg.solve(H, A.T @ (late / sigma))
    errors = np.sqrt(np.diag(np.linalg.inv(H)))
    return MarkerClock(float(offset), float(drift), at, float(errors[0]), float(errors[1]), matched)


def _resolution(seen: Edges, logged: Edges) -> float:
    """Distance [s] below which two offsets may be the same."""
    width = 4 * float(np.median(seen.half) + np.median(logged.half))
    return width + DRIFT_SIGMA * float(np.ptp(seen.span))


def _matches(seen: Edges, logged: Edges, roughly: float | None) -> list[_Match]:
    """Matches at the offsets around which most pairs of edges lie."""
    late = seen.time[:, None] - logged.time
    # an edge in a gap of the frames or of the log gives no offset
    sharp = [e.half <= 2 * np.median(e.half) for e in (seen, logged)]
    possible = (seen.rises[:, None] == logged.rises) & sharp[0][:, None] & sharp[1]
    if roughly is not None:
        possible &= np.abs(late - roughly) <= _ROUGHLY
    i, k = np.nonzero(possible)
    width = _resolution(seen, logged)
    order = np.sort(late[i, k])
    votes = np.searchsorted(order, late[i, k] + width) - np.searchsorted(order, late[i, k] - width)
    first = np.argsort(-votes, kind="stable")[:_CANDIDATES]
    return [_match(seen, logged, int(i[j]), int(k[j])) for j in first]


def _match(seen: Edges, logged: Edges, i: int, k: int) -> _Match:
    """Pairs of edges at the offset at which edge i seen and edge k logged are the same."""
    offset = float(seen.time[i] - logged.time[k])
    there = logged.time + offset
    near = np.asarray(np.searchsorted((there[1:] + there[:-1]) / 2, seen.time), dtype=int)
    distance = np.abs(there[near] - seen.time)
    # the offset itself has the error of two edges; and the clocks may drift
    allowed = seen.half + logged.half[near] + (seen.half[i] + logged.half[k])
    allowed = allowed + DRIFT_SIGMA * np.abs(seen.time - seen.time[i])
    fits = np.flatnonzero((distance <= allowed) & (logged.rises[near] == seen.rises))
    _, once = np.unique(near[fits], return_index=True)
    fits = fits[once]
    start, stop = logged.span[0] + offset, logged.span[1] + offset
    both = int(((seen.time > start) & (seen.time < stop)).sum())
    both += int(((there > seen.span[0]) & (there < seen.span[1])).sum())
    pairs = np.stack([fits, near[fits]], axis=1)
    return _Match(pairs, offset, max(both - 2 * len(pairs), 0), float(distance[fits].sum()))
