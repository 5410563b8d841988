"""Shooting with a drifting torque clock: delay and drift of the torque are parameters.

The torque logged at time t acts at t + delay + drift (t - middle). Within a sample interval that is
a delay, so that the derivatives by the drift are (t - middle) times those by the delay.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array, usual_step
from frictionid.data.plants import Calibration
from frictionid.data.signals import Signal
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

MAX_DRIFT = 0.01
DRIFT_SIGMA = 5e-4  # prior standard deviation: of quartz clocks
# A step of the clock is named beyond this many standard errors, this size [s] and half a frame
# (healthy simulated motions: at most 4.3 errors), where the motion shows this share of the most.
_ERRORS, _LEAST, _SHOWN = 5.0, 0.003, 0.02
_PLACES, _ENDS = 100, 0.05  # where a step is tried, and share of the windows that lie beyond


@dataclass(frozen=True)
class ClockCalibration(Calibration):
    """A calibration with a torque clock that drifts: `drift` () [1], positive where it is slow."""

    drift: float = 0.0


@dataclass(frozen=True)
class DriftBlock(ParameterBlock):
    """Drift of the torque's clock [1]; `prior` is its prior standard deviation."""

    prior: float | None = DRIFT_SIGMA
    name, enters = "drift", "torque"

    def listed(self, estimate: Estimate) -> Iterator[Parameter]:
        drift = float(self.numbers(estimate))
        yield Parameter(self.name, "clock drift", "1", drift, -MAX_DRIFT, MAX_DRIFT)

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
