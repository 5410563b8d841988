"""Offset and drift between the clocks of angles and torque, from the motion, with intervals."""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.check.hypothesis_tests import delay_of
from frictionid.check.motion import motions_of, unit_rows
from frictionid.check.partial_regression import PARAMETER_PRIOR
from frictionid.data.integrals import integrals_of
from frictionid.data.plants import Calibration, plant_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, cut
from frictionid.errors import InputError
from frictionid.fitting.fit import Covariance
from frictionid.fitting.identifiers import LeastSquares
from frictionid.fitting.one_step.balances import Rows
from frictionid.fitting.one_step.recipe import INTEGRAL, states_of, training_problem
from frictionid.fitting.parameter_block import Estimate, ParameterBlock
from frictionid.fitting.parameters import FrictionBlock, InertiaBlock
from frictionid.fitting.shooting import (
    Intervals,
    Settings,
    Solution,
    intervals_of,
    solve,
)
from frictionid.friction.laws import Stribeck
from frictionid.mechanics import Mechanism

from .cross_correlation import CoarseOffset, around, coarse_offset
from .drifting_clocks import clock_step, drifting

LAW = Stribeck(symmetric=False)
# Longer windows carry more information. Where a joint sticks and slips their prediction has kinks:
# the fit does not converge, and its error exceeds its interval (simulated acrobots). Then the
# shorter windows count.
_SHORT_WINDOWS = Settings(windows=(5 / 60, 10 / 60), iterations=25)
_LONG_WINDOWS = Settings(windows=(20 / 60,), iterations=25)
# Friction's shape and sticking joints move the offset by more than the scatter between stretches of
# the motion shows: calibrated on 68 simulated acrobots of 30 s.
_WIDENING = 1.4
_EXACT = 10_000  # degrees of freedom of an interval that no fit has estimated
_UNKNOWN = 0.1  # [s]: a standard error of the offset at which it counts as unknown
_ROUNDS = 3
_CLOSE = 0.005  # [s]: a remaining delay that needs another round
_PIECE = 30.0  # [s] of motion for one delay by the balances; two of them give a drift
_MAX_INTERVALS = 3600  # of shooting: of longer motion, stretches spread over all of it are used
_STRETCH = 5.0  # [s]


class Clock(NamedTuple):
    """Relation between the log's clock and the angles' clock.

    angles' time = log's time + offset + drift (log's time - at)

    Attributes
    ----------
    offset : [s], at the log's time `at`
    drift : [1], positive where the log's clock is too slow
    at : [s]

    >>> Clock(0.1, 1e-4, 10.0).to_angles(np.array([10.0, 20.0])).round(6).tolist()
    [10.1, 20.101]
    """

    offset: float
    drift: float
    at: float

    def to_angles(self, time: Array) -> Array:
        """Times (K,) by the angles' clock."""
        return time + self.offset + self.drift * (time - self.at)

    def to_log(self, time: Array) -> Array:
        """Times (K,) by the log's clock."""
        since = (time - self.at - self.offset) / (1.0 + self.drift)
        return self.at + since

    def offset_at(self, time: float) -> float:
        """Offset [s] at a time of the log's clock."""
        return float(self.offset + self.drift * (time - self.at))

    def later(self, delay: float, drift: float) -> "Clock":
        """The clock corrected by a remaining delay [s] at `at`, and a remaining drift."""
        return Clock(self.offset + delay, self.drift + drift * (1.0 + self.drift), self.at)


class Alignment(NamedTuple):
    """Estimated relation of the clocks.

    Attributes
    ----------
    clock : Clock
    covariance : array, shape (2, 2), of offset (at `clock.at`) and drift
    degrees_of_freedom : of the t distribution that the covariance belongs to
    span : first and last time [s] of the log's clock that the motion covers
    viscous : array, shape (n,), viscous friction of the fit [N m s/rad]
    viscous_slope : array, shape (n,), its change per second of offset [N m s/rad / s]
    coarse : CoarseOffset, None where a clock was given in its place
    step : time and size [s], by the angles' clock, of a step of the torque's, or None
    converged : whether the fit converged
    marker_only : why the motion does not determine the clock, where the marker alone does; then
        `viscous` and `viscous_slope` are nan
    """

    clock: Clock
    covariance: Array
    degrees_of_freedom: int
    span: tuple[float, float]
    viscous: Array
    viscous_slope: Array
    coarse: CoarseOffset | None
    converged: bool
    marker_only: str = ""
    step: tuple[float, float] | None = None

    def error_at(self, time: float) -> float:
        """Standard error [s] of the offset at a time of the log's clock."""
        v = np.array([1.0, time - self.clock.at])
        return float(np.sqrt(v @ self.covariance @ v))

    @property
    def drift_error(self) -> float:
        """Standard error of the drift [1]."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def t_quantile(self) -> float:
        """Half-width of a 95 % interval in standard errors."""
        return float(stdtrit(self.degrees_of_freedom, 0.975))


def align(
    mechanism: Mechanism, angle: Signal, torque: Signal, start: Clock | None = None
) -> Alignment:
    """Offset and drift of a torque log against angles of the same motion.

    First by cross-correlation, then by the momentum balances, then by shooting from the measured
    angles with friction and base parameters free, over long windows where that converges.

    Parameters
    ----------
    mechanism : with its nominal values
    angle : n columns, by the camera's clock; torque : n columns, by the log's
    start : Clock, optional, such as a marker's, in place of the cross-correlation

    Raises
    ------
    InputError
        Where the log explains the motion nowhere, or in several places.
    """
    nothing = Signal(angle.time, np.zeros_like(angle.value))
    dataset = Dataset("align", mechanism, (Recording("motion", angle, nothing),))
    plant = plant_of(dataset)
    nominal = np.asarray(plant.p)[0]
    rows = unit_rows(plant.mechanism, motions_of(dataset.recordings))
    coarse, clock = None, start
    if clock is None:
        coarse = coarse_offset(plant.mechanism, nominal, rows, angle, torque)
        first = max(angle.time[0], torque.time[0] + coarse.offset)
        last = min(angle.time[-1], torque.time[-1] + coarse.offset)
        clock = Clock(coarse.offset, 0.0, (first + last) / 2 - coarse.offset)
    for _ in range(_ROUNDS):
        data = _together(dataset, angle, torque, clock)
        delays = _delays(rows, data.recordings[0], nominal)
        clock = _improved(clock, delays)
        if max(abs(d) for _, d in delays) < _CLOSE:
            break
    data = _together(dataset, angle, torque, clock)
    return _by_shooting(data, clock, coarse)


def by_marker(
    clock: Clock, errors: tuple[float, float], angle: Signal, torque: Signal, reason: str
) -> Alignment:
    """Alignment by a marker alone, where the motion does not determine the clock.

    errors : standard deviations of offset [s] and drift; reason : see `Alignment.marker_only`

    Raises
    ------
    InputError
        Where angles and log then share no motion.
    """
    moved = torque._replace(time=clock.to_angles(torque.time))
    span = clock.to_log(_common(angle, moved).time[[0, -1]])
    unknown = np.full(angle.value.shape[1], np.nan)
    return Alignment(
        clock,
        covariance=np.diag(np.square(errors)),
        degrees_of_freedom=_EXACT,
        span=(float(span[0]), float(span[1])),
        viscous=unknown,
        viscous_slope=unknown,
        coarse=None,
        converged=True,
        marker_only=reason,
    )


def _together(dataset: Dataset, angle: Signal, torque: Signal, clock: Clock) -> Dataset:
    """Data set of the common motion, all on the angles' clock."""
    moved = torque._replace(time=clock.to_angles(torque.time))
    common = _common(angle, moved)
    near = around(moved, common.time[0], common.time[-1])
    recording = Recording("motion", common, near)
    return Dataset(dataset.name, dataset.mechanism, (recording,))


def _common(angle: Signal, moved: Signal) -> Signal:
    """Angles during a log on their clock."""
    common = cut(angle, moved.time[0], moved.time[-1])
    if len(common.time) < 10:
        raise InputError("angles and log share no motion: were both recorded at the same time?")
    return common


def _delays(rows: Rows, recording: Recording, nominal: Array) -> list[tuple[float, float]]:
    """Middle [s], by the angles' clock, and delay [s] of each piece of the motion, by balances."""
    time = recording.angle.time
    logged = integrals_of([recording.torque])
    count = max(1, min(int((time[-1] - time[0]) / _PIECE), 20))
    edges = np.linspace(time[0], time[-1], count + 1)
    out = []
    for a, b in pairwise(edges):
        inside = (rows.start >= a) & (rows.stop <= b)
        delay = delay_of(rows.where(inside), logged, nominal[None])
        if delay is not None and np.isfinite(delay.seconds):
            out.append((float(a + b) / 2, delay.seconds))
    return out or [(float(time[0] + time[-1]) / 2, 0.0)]


def _improved(clock: Clock, delays: list[tuple[float, float]]) -> Clock:
    """The clock corrected by a line through the delays, robustly (Theil-Sen).

    Slope: median of the slopes between all pairs; level: median of what it leaves.
    """
    middle, delay = np.array(delays).T
    if len(delays) < 2:
        return clock.later(float(delay[0]), 0.0)
    at = float(clock.to_angles(np.array(clock.at)))
    i, k = np.triu_indices(len(middle), 1)
    drift = float(np.median((delay[k] - delay[i]) / (middle[k] - middle[i])))
    return clock.later(float(np.median(delay - drift * (middle - at))), drift)


def _by_shooting(data: Dataset, clock: Clock, coarse: CoarseOffset | None) -> Alignment:
    """The clock corrected by delay and drift of the torque, estimated by shooting.

    With theta = (friction, base parameters, delay, drift), the squares of the angle residuals plus
    those of the priors are minimised. Delay and drift correct the clock; their covariance is
    clustered by stretches of the motion, the offset's widened (`_WIDENING`).
    """
    fit = _solved(data, clock)
    covariance = fit.covariance()
    k = [_place(covariance, "delay"), _place(covariance, "drift")]
    delay, drift = covariance.values[k]
    pair = covariance.matrix[np.ix_(k, k)]
    pair = pair * np.outer([_WIDENING, 1.0], [_WIDENING, 1.0])
    if not (np.isfinite(pair).all() and pair[0, 0] < _UNKNOWN**2):
        raise InputError(
            "the motion does not determine the offset of the clocks: record longer, or livelier "
            "motion"
        )
    corrected = clock.later(float(delay), float(drift))
    span = corrected.to_log(data.recordings[0].angle.time[[0, -1]])
    viscous, slope = _viscous(fit, covariance)
    return Alignment(
        corrected,
        covariance=pair,
        degrees_of_freedom=covariance.freedom,
        span=(float(span[0]), float(span[1])),
        viscous=viscous,
        viscous_slope=slope,
        coarse=coarse,
        converged=fit.converged,
        step=clock_step(fit),
    )


def _solved(data: Dataset, clock: Clock) -> Solution:
    """Shooting with short windows, then from there with long ones, kept where these converge."""
    estimate, intervals = _start(data)
    blocks: tuple[ParameterBlock, ...] = (FrictionBlock(), InertiaBlock(prior=PARAMETER_PRIOR))
    middle = float(clock.to_angles(np.array(clock.at)))
    use = _used(intervals)
    short = drifting(intervals, estimate, blocks, _SHORT_WINDOWS, middle)
    solution = solve(short, estimate, use)
    long = replace(short, settings=_LONG_WINDOWS)
    longer = solve(long, solution.estimate, use, solution)
    return longer if longer.converged else solution


def _place(covariance: Covariance, block: str) -> int:
    """Place of the only parameter of a block."""
    return [p.block for p in covariance.parameters].index(block)


def _start(data: Dataset) -> tuple[Estimate, Intervals]:
    """Friction by least squares on one-step residuals, nominal base parameters; the intervals."""
    plant = plant_of(data)
    states = states_of(data, INTEGRAL.states, None)
    problem = training_problem(data, plant, INTEGRAL, states=states)
    friction = LeastSquares(LAW).fit(problem, np.ones((1, len(problem.r))), 0)[0]
    calibration = Calibration.ideal(plant.n, np.asarray(plant.p)[0])
    return Estimate(friction, calibration, plant.mechanism), intervals_of(data, states=states)


def _used(intervals: Intervals) -> Array:
    """Intervals (K,) that are used: all, or stretches spread over a long motion."""
    K = len(intervals.dt)
    if K <= _MAX_INTERVALS:
        return np.ones(K, dtype=bool)
    width = max(int(_STRETCH / float(np.median(intervals.dt))), 4)
    every = K / _MAX_INTERVALS
    return (np.arange(K) % int(width * every)) < width


def _viscous(solution: Solution, covariance: Covariance) -> tuple[Array, Array]:
    """Viscous friction (n,) of each joint, and its change (n,) per second of offset.

    With the offset held at a value that is wrong by d, the other parameters o move by

        -H_oo^-1 H_od d

    where H is the Hessian of the fit. Friction that is not identified is held, such as a Stribeck
    peak that is not there: together with the viscous friction it could move by any amount.
    """
    parameters, k = covariance.parameters, _place(covariance, "delay")
    H = solution.curvature + np.diag(solution.problem.limits.precision)
    viscous = [p.block == "friction" and LAW.names[p.place[1]] == "viscous" for p in parameters]
    friction = np.array([p.block == "friction" for p in parameters])
    moves = solution.free & (covariance.identified | viscous | ~friction)
    others = np.array([i for i in np.flatnonzero(moves) if i != k])
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H)[others], 1e-300))
    inner = H[np.ix_(others, others)] * np.outer(scale, scale)
    move = -scale * np.linalg.lstsq(inner, scale * H[others, k], rcond=1e-9)[0]
    value, slope = np.zeros((2, solution.problem.intervals.n))
    for i, step in zip(others, move, strict=True):
        if viscous[i]:
            j = parameters[i].place[0]
            value[j], slope[j] = covariance.values[i], step
    return value, slope
