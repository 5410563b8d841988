"""Shooting with a drifting torque clock: delay and drift of the torque are parameters.

The torque logged at time t acts at t + delay + drift (t - middle). Within a sample interval that is
a delay, so that the derivatives by the drift are (t - middle) times those by the delay.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration
from frictionid.fitting.parameters import DelayBlock, Estimate, Parameter, ParameterBlock
from frictionid.fitting.parameters.parameter_block import free_blocks
from frictionid.fitting.shooting import (
    Intervals,
    Linearisation,
    Settings,
    ShootingProblem,
    shooting_problem,
)

MAX_DRIFT = 0.01
DRIFT_SIGMA = 5e-4  # prior standard deviation: of quartz clocks


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
        moved = drifted(self.intervals, _drift_of(estimate), self.middle)
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
    return Drifting(intervals, free, settings, inner.reads, inner, middle)


def _drift_of(estimate: Estimate) -> float:
    calibration = estimate.calibration
    return calibration.drift if isinstance(calibration, ClockCalibration) else 0.0


def drifted(intervals: Intervals, drift: float, middle: float) -> Intervals:
    """The intervals with their torque on the drifting clock."""
    recordings = tuple(
        replace(r, torque=r.torque._replace(time=r.torque.time + drift * (r.torque.time - middle)))
        for r in intervals.dataset.recordings
    )
    return replace(intervals, dataset=replace(intervals.dataset, recordings=recordings))
