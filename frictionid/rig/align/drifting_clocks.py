"""Clocks that drift, tied by the motion or by the edges of a sync LED.

By the motion: shooting with delay and drift of the torque as parameters. The torque logged at time
t acts at t + delay + drift (t - middle). Within a sample interval that is a delay, so that the
derivatives by the drift are (t - middle) times those by the delay.

By edges that both sides record: an LED in the picture whose switch the drive logs. Each edge lies
between two frames, or within the exposure of a frame that is lit in part, and between two rows of
the log. Edges are matched by the pattern of their intervals; a line through the matched pairs gives
offset and drift.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.data.plants import Calibration
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.fitting.parameter_block import Estimate, Parameter, ParameterBlock, free_blocks
from frictionid.fitting.parameters import DelayBlock
from frictionid.fitting.sandwich import Groups, sandwich, step_of
from frictionid.fitting.shooting import (
    Intervals,
    Linearisation,
    Settings,
    ShootingProblem,
    Solution,
    shooting_problem,
)

_MAX_DRIFT = 0.01
_DRIFT_SIGMA = 5e-4  # prior standard deviation: of quartz clocks


# --- The motion -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class ClockCalibration(Calibration):
    """A calibration with a torque clock that drifts: `drift` () [1], positive where it is slow."""

    drift: float = 0.0


@dataclass(frozen=True)
class DriftBlock(ParameterBlock):
    """Drift of the torque's clock [1]; `prior` is its prior standard deviation."""

    prior: float | None = _DRIFT_SIGMA
    name, enters = "drift", "torque"

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        drift = float(self.numbers(estimate))
        yield Parameter(self.name, "clock drift", "1", drift, -_MAX_DRIFT, _MAX_DRIFT)

    def numbers(self, estimate: Estimate) -> Array:
        return np.asarray(_drift_of(estimate))

    def with_numbers(self, estimate: Estimate, numbers: Array) -> Estimate:
        parts = {**vars(estimate.calibration), "drift": float(numbers)}
        return estimate._replace(calibration=ClockCalibration(**parts))


@dataclass(frozen=True, eq=False)
class Drifting(ShootingProblem):
    """The problem of a torque with a clock of its own, right at `middle` [s] but for its delay."""

    inner: ShootingProblem
    middle: float

    def linearise(self, estimate: Estimate, nodes: Array, rows: Array) -> Linearisation:
        """End states and derivatives of some intervals (k,) that begin at nodes (K, s)."""
        drift, dataset = _drift_of(estimate), self.intervals.dataset
        recordings = []
        for r in dataset.recordings:
            time = r.torque.time + drift * (r.torque.time - self.middle)
            recordings.append(replace(r, torque=r.torque._replace(time=time)))
        moved = replace(self.intervals, dataset=replace(dataset, recordings=tuple(recordings)))
        linear = replace(self.inner, intervals=moved).linearise(estimate, nodes, rows)
        since = (self.intervals.time + self.intervals.dt / 2 - self.middle)[:, None, None]
        # the drift comes last, and the delay last before it
        by = np.concatenate([linear.by, since * linear.by[..., -1:]], axis=-1)
        return linear._replace(by=by, angle=np.pad(linear.angle, ((0, 1), (0, 0))))


def drifting(
    intervals: Intervals,
    estimate: Estimate,
    blocks: Sequence[ParameterBlock],
    settings: Settings,
    middle: float,
) -> Drifting:
    """The problem of fitting delay, drift and other blocks to the intervals."""
    blocks = (*blocks, DelayBlock())
    inner = shooting_problem(intervals, estimate, blocks, settings)
    free = free_blocks((*blocks, DriftBlock()), estimate)
    return Drifting(intervals, free, settings, inner.reads, inner.directions, inner, middle)


def _drift_of(estimate: Estimate) -> float:
    calibration = estimate.calibration
    return calibration.drift if isinstance(calibration, ClockCalibration) else 0.0


# A step of the clock is named beyond this many standard errors, this size [s] and half a frame
# (healthy simulated motions: at most 4.3 errors), where the motion shows this share of the most.
_ERRORS, _LEAST, _SHOWN = 5.0, 0.003, 0.02
_PLACES, _ENDS = 100, 0.05  # where a step is tried, and share of the windows that lie beyond


def clock_step(solution: Solution) -> tuple[float, float] | None:
    """Time and size [s] of the step of the torque's clock that explains most; None of no clear one.

    Each step is one more parameter of the fit, the delay of the windows behind it, to first order.
    """
    problem, groups = solution.problem, solution.groups
    delay = [p.block for p in problem.parameters].index("delay")
    time = problem.intervals.time[solution.windows[:, 0]][solution.closed]
    precision = np.diag(np.append(problem.limits.precision, 0.0))

    def tried(place: float) -> tuple[Array, Groups, float]:
        later = _with_step(groups, delay, time >= place)
        H, g = later.H.sum(axis=0) + precision, later.g.sum(axis=0)
        g[:-1] = 0.0  # the fit has come to its minimum
        return H, later._replace(move=step_of(H, g, later.free)), float(g[-1])

    places = np.quantile(time, np.linspace(_ENDS, 1.0 - _ENDS, _PLACES))
    steps = np.array([(later.move[-1], g) for _, later, g in map(tried, places)])
    shown = steps[:, 1] / (steps[:, 0] + 1e-300)  # inverse variances
    place = float(places[np.argmax(steps.prod(axis=1) * (shown > _SHOWN * shown.max()))])
    H, later, _ = tried(place)
    size, error = float(later.move[-1]), float(np.sqrt(sandwich(H, later)[-1, -1]))
    least = max(_ERRORS * error, _LEAST, float(np.median(problem.intervals.dt)) / 2)
    return (place, size) if abs(size) > least else None


def _with_step(groups: Groups, delay: int, later: Array) -> Groups:
    """The groups where a fit ended, with one more parameter: the delay of the later ones (W,)."""
    W, D = groups.g.shape
    wider = np.zeros((W, D, D + 1))
    wider[:, range(D), range(D)] = 1.0
    wider[later, delay, D] = 1.0
    H = np.swapaxes(wider, 1, 2) @ groups.H @ wider
    g = (groups.score[:, None] @ wider)[:, 0]
    return groups._replace(H=H, g=g, free=np.append(groups.free, True))


def lost_frames(angle: Signal, step: tuple[float, float]) -> tuple[float, float] | None:
    """Time [s] of the frame before lost ones, and how long [s] they took; None if none are lost.

    Near the step of the clock it is the frame from which the joints move on by as much more.
    """
    frame = usual_step(angle.time)
    lost = round(-step[1] / frame)
    reach = 1.0 + 2.0 * angle.duration / _PLACES
    near = np.flatnonzero(np.abs(angle.time[1:-2] - step[0]) < reach) + 1
    if lost < 1 or not len(near):
        return None
    moves = np.diff(angle.value, axis=0)
    usual = lost * (moves[near - 1] + moves[near + 1]) / 2
    beyond = moves[near] - usual / lost
    fewer = (beyond**2 - (beyond - usual) ** 2).sum(axis=-1)  # squares that the gap explains
    k = int(np.argmax(fewer))
    return (float(angle.time[near[k]]), lost * frame) if fewer[k] > 0 else None


# --- Edges of a sync LED --------------------------------------------------------------------------

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
    H = A.T @ A + np.diag([0.0, 1.0 / _DRIFT_SIGMA**2])
    offset, drift = np.linalg.solve(H, A.T @ (late / sigma))
    errors = np.sqrt(np.diag(np.linalg.inv(H)))
    return MarkerClock(float(offset), float(drift), at, float(errors[0]), float(errors[1]), matched)


def _resolution(seen: Edges, logged: Edges) -> float:
    """Distance [s] below which two offsets may be the same."""
    width = 4 * float(np.median(seen.half) + np.median(logged.half))
    return width + _DRIFT_SIGMA * float(np.ptp(seen.span))


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
    allowed = allowed + _DRIFT_SIGMA * np.abs(seen.time - seen.time[i])
    fits = np.flatnonzero((distance <= allowed) & (logged.rises[near] == seen.rises))
    _, once = np.unique(near[fits], return_index=True)
    fits = fits[once]
    start, stop = logged.span[0] + offset, logged.span[1] + offset
    both = int(((seen.time > start) & (seen.time < stop)).sum())
    both += int(((there > seen.span[0]) & (there < seen.span[1])).sum())
    pairs = np.stack([fits, near[fits]], axis=1)
    return _Match(pairs, offset, max(both - 2 * len(pairs), 0), float(distance[fits].sum()))
