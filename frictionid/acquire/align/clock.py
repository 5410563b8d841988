"""Offset and drift between two clocks from the motion itself, with intervals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.acquire.align.cross_correlation import Match, around, match
from frictionid.acquire.align.drifting import drifting
from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows, unit_rows
from frictionid.check.delay import delay_of
from frictionid.check.motion import motions_of
from frictionid.check.partial_regression import PARAMETER_PRIOR
from frictionid.data.integrals import integrals_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal, cut
from frictionid.errors import InputError
from frictionid.friction.laws import AsymmetricStribeck
from frictionid.identifiers import LeastSquares
from frictionid.identifiers.formulation import INTEGRAL, states_of, training_problem
from frictionid.mechanics import plant_of
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting.covariance import Covariance, covariance_of
from frictionid.shooting.gauss_newton import Shot, settle
from frictionid.shooting.intervals import Track, track_of
from frictionid.shooting.linearise import values_of
from frictionid.shooting.parameters import Block, FrictionBlock, InertiaBlock
from frictionid.shooting.parameters.parameter_block import Guess
from frictionid.shooting.settings import Settings

LAW = AsymmetricStribeck()
# Longer windows tell more. Where a joint sticks and slips they have kinks, the fit does not settle,
# and is led astray by more than its interval (simulated acrobots): then the shorter ones count.
WINDOWS = Settings(windows=(5 / 60, 10 / 60), iterations=25)
LONG = Settings(windows=(20 / 60,), iterations=25)
# Friction's shape and joints that stick move the offset by more than stretches of the motion show:
# calibrated on 68 simulated acrobots of 30 s.
WIDER = 1.4
_MANY = 10_000  # degrees of freedom of what is told by no fit
_LOST = 0.1  # [s]: an error of the offset that says that nothing is known
_ROUNDS = 3
_CLOSE = 0.005  # [s]: a delay that is left and needs another round
_PIECE = 30.0  # [s] of motion that tell the drift's first value, two of them at least
MOST_INTERVALS = 3600  # of shooting: of longer motion, stretches spread over all of it
_STRETCH = 5.0  # [s]


class Clock(NamedTuple):
    """What the log's clock shows at an instant of the angles' clock, and the other way round.

    angles' time = log's time + offset + drift (log's time - at)

    offset [s] at the log's time `at` [s]; drift [1], positive where the log's clock is too slow.

    >>> Clock(0.1, 1e-4, 10.0).to_angles(np.array([10.0, 20.0])).round(6).tolist()
    [10.1, 20.101]
    """

    offset: float
    drift: float
    at: float

    def to_angles(self, time: Array) -> Array:
        """Times (K,) by the angles' clock."""
        return np.asarray(time + self.offset + self.drift * (time - self.at))

    def to_log(self, time: Array) -> Array:
        """Times (K,) by the log's clock."""
        since = (time - self.at - self.offset) / (1.0 + self.drift)
        return np.asarray(self.at + since)

    def offset_at(self, time: float) -> float:
        """Offset [s] at a time of the log's clock."""
        return float(self.offset + self.drift * (time - self.at))

    def later(self, delay: float, drift: float) -> Clock:
        """The clock after what was found to be left, at `at`."""
        return Clock(self.offset + delay, self.drift + drift * (1.0 + self.drift), self.at)


@dataclass(frozen=True, eq=False)
class Alignment:
    """Clocks brought together.

    clock : Clock; matrix (2, 2) : covariance of offset (at `clock.at`) and drift, of a t
        distribution with `freedom` degrees
    span : (2,) [s] of the log's clock that the motion covers
    viscous : (n,) change of each joint's viscous friction per second of offset [N m s/rad / s]
    found : viscous friction (n,) of that fit; coarse : Match
    noise : (n,) [rad] of the angles; settled : whether the fit came to an end
    why : why the motion did not tell the clock, where a marker alone does; `viscous`, `found` and
        `noise` are then nan
    """

    clock: Clock
    matrix: Array
    freedom: int
    span: tuple[float, float]
    viscous: Array
    found: Array
    coarse: Match
    noise: Array
    settled: bool
    why: str = ""

    def error_at(self, time: float) -> float:
        """Standard error [s] of the offset at a time of the log's clock."""
        v = np.array([1.0, time - self.clock.at])
        return float(np.sqrt(v @ self.matrix @ v))

    @property
    def drift_error(self) -> float:
        """Standard error of the drift [1]."""
        return float(np.sqrt(self.matrix[1, 1]))

    @property
    def reach(self) -> float:
        """Half-width of a 95 % interval in standard errors."""
        return float(stdtrit(self.freedom, 0.975))


def align(
    mechanism_table: dict[str, object],
    angle: Signal,
    torque: Signal,
    settings: Settings | None = None,
    known: Clock | None = None,
) -> Alignment:
    """Offset and drift of a torque log against angles of the same motion.

    Coarse by cross-correlation, then by the momentum balances, and at last by shooting, with
    friction and base parameters free: from the measured angles themselves.

    Parameters
    ----------
    mechanism_table : the [mechanism] table
    angle : n columns, by the camera's clock; torque : n columns, by the log's
    known : Clock, optional; a marker's, which takes the place of the coarse search

    Raises
    ------
    InputError
        Where the log explains the motion nowhere, or in several places.
    """
    dataset = Dataset("align", mechanism_table, (Recording("motion", angle, _silent(angle)),))
    plant = plant_of(dataset)
    told = np.asarray(plant.p)[0]
    rows = unit_rows(plant.mechanism, motions_of(dataset.recordings))
    if known is None:
        coarse = match(plant.mechanism, told, rows, angle, torque)
        clock = _first(angle, torque, coarse)
    else:
        coarse, clock = _marked(known), known
    for _ in range(_ROUNDS):
        data = _together(dataset, angle, torque, clock)
        delays = _delays(rows, data.recordings[0], told)
        clock = _improved(clock, delays)
        if max(abs(d) for _, d in delays) < _CLOSE:
            break
    data = _together(dataset, angle, torque, clock)
    return _fine(data, clock, coarse, settings)


def by_marker(
    clock: Clock, errors: tuple[float, float], angle: Signal, torque: Signal, why: str
) -> Alignment:
    """Clocks as a marker ties them, where the motion does not tell.

    errors : standard deviations of offset [s] and drift; why : as in `Alignment`

    Raises
    ------
    InputError
        Where angles and log then share no motion.
    """
    moved = torque._replace(time=clock.to_angles(torque.time))
    span = clock.to_log(_common(angle, moved).time[[0, -1]])
    nothing = np.full(angle.value.shape[1], np.nan)
    return Alignment(
        clock,
        np.diag(np.square(errors)),
        _MANY,
        (float(span[0]), float(span[1])),
        nothing,
        nothing,
        _marked(clock),
        nothing,
        True,
        why,
    )


def _silent(angle: Signal) -> Signal:
    return Signal(angle.time, np.zeros_like(angle.value))


def _marked(clock: Clock) -> Match:
    nothing = np.zeros(0)
    return Match(clock.offset, float("nan"), (float("nan"), float("nan")), 0.0, nothing, nothing)


def _first(angle: Signal, torque: Signal, found: Match) -> Clock:
    """Clock of a coarse offset, which it has in the middle of the common motion."""
    first = max(angle.time[0], torque.time[0] + found.offset)
    last = min(angle.time[-1], torque.time[-1] + found.offset)
    return Clock(found.offset, 0.0, (first + last) / 2 - found.offset)


def _together(dataset: Dataset, angle: Signal, torque: Signal, clock: Clock) -> Dataset:
    """The common motion as a data set on the angles' clock."""
    moved = torque._replace(time=clock.to_angles(torque.time))
    common = _common(angle, moved)
    near = around(moved, common.time[0], common.time[-1])
    recording = Recording("motion", common, near)
    return Dataset(dataset.name, dataset.mechanism, (recording,))


def _common(angle: Signal, moved: Signal) -> Signal:
    """Angles while a log on their clock lasts."""
    common = cut(angle, moved.time[0], moved.time[-1])
    if len(common.time) < 10:
        raise InputError("angles and log share no motion: were both recorded at the same time?")
    return common


def _delays(rows: Rows, recording: Recording, told: Array) -> list[tuple[float, float]]:
    """Middle [s], by the angles' clock, and delay [s] of each piece of the motion."""
    time = recording.angle.time
    logged = integrals_of([recording.torque])
    count = max(1, min(int((time[-1] - time[0]) / _PIECE), 20))
    edges = np.linspace(time[0], time[-1], count + 1)
    out = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        own = (rows.start >= a) & (rows.stop <= b)
        delay = delay_of(rows.where(own), logged, told[None])
        if delay is not None and np.isfinite(delay.seconds):
            out.append((float(a + b) / 2, delay.seconds))
    return out or [(float(time[0] + time[-1]) / 2, 0.0)]


def _improved(clock: Clock, delays: list[tuple[float, float]]) -> Clock:
    middle, delay = np.array(delays).T
    if len(delays) < 2:
        return clock.later(float(delay[0]), 0.0)
    at = float(clock.to_angles(np.array(clock.at)))
    # a piece that was led astray must not turn the line: slopes between pairs, their median
    i, k = np.triu_indices(len(middle), 1)
    drift = float(np.median((delay[k] - delay[i]) / (middle[k] - middle[i])))
    return clock.later(float(np.median(delay - drift * (middle - at))), drift)


def _fine(data: Dataset, clock: Clock, coarse: Match, settings: Settings | None) -> Alignment:
    """Shooting of delay and drift together with friction and base parameters."""
    plant, n = plant_of(data), plant_of(data).mechanism.n
    states = states_of(data, INTEGRAL.states, None)
    problem = training_problem(data, plant, INTEGRAL, states=states)
    friction = LeastSquares(LAW).fit(problem, np.ones((1, len(problem.r))), 0)[0]
    calibration = Calibration.ideal(n, np.asarray(plant.p)[0])
    guess = Guess(friction, calibration, plant.mechanism)
    blocks: tuple[Block, ...] = (FrictionBlock(), InertiaBlock(prior=PARAMETER_PRIOR))
    track = track_of(data, states=states)
    middle = float(clock.to_angles(np.array(clock.at)))
    intervals, use = drifting(track, guess, blocks, settings or WINDOWS, middle), _used(track)
    shot = settle(intervals, guess, use)
    if settings is None:
        longer = replace(intervals, settings=LONG)
        mean = values_of(guess, intervals.parts)
        refined = settle(longer, shot.guess, use, shot.nodes, mean=mean)
        intervals, shot = (longer, refined) if refined.settled else (intervals, shot)
    covariance = covariance_of(intervals, shot)
    names = [e.block for e in covariance.entries]
    k, m = names.index("delay"), names.index("drift")
    delay, drift = covariance.values[k], covariance.values[m]
    pair = covariance.matrix[np.ix_([k, m], [k, m])]
    pair = pair * np.outer([WIDER, 1.0], [WIDER, 1.0])
    if not (np.isfinite(pair).all() and pair[0, 0] < _LOST**2):
        raise InputError(
            "the motion does not tell the offset of the clocks: record livelier motion, or longer"
        )
    time = data.recordings[0].angle.time
    found = clock.later(float(delay), float(drift))
    span = found.to_log(time[[0, -1]])
    viscous = _viscous(covariance, shot, n)
    return Alignment(
        found,
        pair,
        covariance.freedom,
        (float(span[0]), float(span[1])),
        *viscous,
        coarse,
        shot.sigma,
        bool(shot.settled),
    )


def _used(track: Track) -> Array:
    """Intervals (K,) that are shot at: all, or stretches spread over a long motion."""
    K = len(track.dt)
    if K <= MOST_INTERVALS:
        return np.ones(K, dtype=bool)
    width = max(int(_STRETCH / float(np.median(track.dt))), 4)
    every = K / MOST_INTERVALS
    return np.asarray((np.arange(K) % int(width * every)) < width)


def _viscous(covariance: Covariance, shot: Shot, n: int) -> tuple[Array, Array]:
    """What a second of offset does to each joint's viscous friction, all else refitted; its value.

    With the offset held where it is wrong by d, the others move by -H_oo^-1 H_od d.
    """
    entries = covariance.entries
    H = shot.normal.H[shot.closed].sum(axis=0)
    H = H + np.diag([1.0 / e.prior**2 for e in entries])
    k = [e.block for e in entries].index("delay")
    others = np.array([i for i in range(len(entries)) if i != k and shot.free[i]])
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H)[others], 1e-300))
    inner = H[np.ix_(others, others)] * np.outer(scale, scale)
    move = -scale * np.linalg.lstsq(inner, scale * H[others, k], rcond=1e-9)[0]
    slope, value = np.zeros(n), np.zeros(n)
    names = LAW.names
    for i, step in zip(others, move, strict=True):
        entry = entries[i]
        if entry.block == "friction" and names[entry.place[1]] == "viscous":
            slope[entry.place[0]], value[entry.place[0]] = step, covariance.values[i]
    return slope, value
