"""The recordings as one series of sample intervals, with measured angles and torque on demand."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.integrals import SignalIntegrals, integrals_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.servo import Servo, play
from frictionid.data.signals import Signal, relative_noise, sample
from frictionid.data.state_estimators import RTS, States, resolutions
from frictionid.errors import InputError

from ..one_step.recipe import states_of
from ..one_step.residual import GAP

_APART = 4.0  # [s] between recordings on one clock: twice as much as targets may be late
_LONGEST = 2e4  # [s] on one clock, whose rounding is then far below that of a step's moment


class ServoMotion(NamedTuple):
    """Angles as the controller's encoder shows them, smoothed velocities, and how angles curve.

    curve : (T - 1, n, 2) [rad] of each interval, its Hermite cubic less its chord at s is
        s (1 - s) ((1 - s) curve[..., 0] - s curve[..., 1]); without it a stiff gain would act on
        the chords, which looks like inertia
    play : [rad] by which the encoder lags behind the angles, None where there is no backlash
    parts : of each recording the times of its angles, and its smooth motion
    """

    seen: Signal
    w: Signal
    curve: Array | None = None
    play: Signal | None = None
    parts: tuple[tuple[Array, Signal], ...] = ()

    def behind(self, backlash: float | Array) -> "ServoMotion":
        """The motion as an encoder behind a backlash shows it."""
        if not np.any(backlash):
            return self
        lag = np.concatenate([sample(play(q, backlash), time) for time, q in self.parts])
        seen, z = (self.seen._replace(value=x) for x in (self.seen.value - lag, lag))
        return self._replace(seen=seen, play=z)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Angles and velocities (K, n) at times (K,)."""
        w, clock, seen = sample(self.w, time), self.seen.time, self.seen.value
        if self.curve is None:
            return sample(self.seen, time), w
        k = np.clip(np.searchsorted(clock, time, side="right") - 1, 0, len(clock) - 2)
        s = np.clip((time - clock[k]) / np.diff(clock)[k], 0.0, 1.0)[:, None]
        first, last = np.moveaxis(self.curve[k], -1, 0)
        q = seen[k] + s * (seen[k + 1] - seen[k])
        return q + s * (1 - s) * ((1 - s) * first - s * last), w

    def play_at(self, time: Array) -> Array | float:
        """Play (K, n) at times (K,), zero without backlash."""
        return 0.0 if self.play is None else sample(self.play, time)


class ServoGroup(NamedTuple):
    """Recordings of alike servos, one behind the other on one clock.

    servo, motion : of all, their signals one behind the other; begin, end : (R,) [s] of each, on
    its own clock; later : (R,) [s] by which it is later on theirs, NaN of recordings that are none
    of these
    """

    servo: Servo
    motion: ServoMotion
    begin: Array
    end: Array
    later: Array

    @property
    def members(self) -> list[int]:
        """Recordings of the group."""
        return [int(r) for r in np.flatnonzero(np.isfinite(self.later))]


@dataclass(frozen=True, eq=False)
class Intervals:
    """K intervals between samples, all recordings in one series.

    time, dt : (K,) [s] start and length; recording, index : (K,), of the sample at the start
    before, after : (K, n) [rad] measured at start and end
    weight_before, weight_after : (K, n), relative noise weight: usual noise over own noise, nothing
        for outliers that the states leave out; these are replaced by the smoothed angles
    q, w : (K, n) smoothed states at the start
    joined : (K,), whether an interval begins where the one before it ends
    """

    dataset: Dataset
    states: tuple[States, ...]
    time: Array
    dt: Array
    recording: Array
    index: Array
    before: Array
    after: Array
    weight_before: Array
    weight_after: Array
    q: Array
    w: Array
    joined: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    @cached_property
    def rounding(self) -> Array:
        """Noise (n,) of rounding to the smallest step of the angles: at rest they show no other."""
        angles = np.concatenate([r.angle.value for r in self.dataset.recordings])
        return resolutions(angles) / np.sqrt(12.0)

    @cached_property
    def torque(self) -> SignalIntegrals:
        """Integrals of the logged torques of all recordings."""
        return integrals_of([r.torque for r in self.dataset.recordings])

    @cached_property
    def servos(self) -> list[ServoGroup]:
        """Groups of recordings with a servo."""
        return _groups(self.dataset.recordings, self.states)

    @cached_property
    def temperature(self) -> Array | None:
        """Temperature (K, n) [degC] of joints in the middle of each; None unless all know it."""
        joints = self.dataset.mechanism.joints
        return self._in_the_middle(lambda r, time: r.temperature_at(time, joints))

    @cached_property
    def base_motion(self) -> Array | None:
        """Motion (K, 9) of a floating base in the middle of each; None where it does not move."""
        return self._in_the_middle(lambda r, time: r.base_motion and sample(r.base_motion, time))

    @property
    def middle(self) -> Array:
        """Time (K,) [s] in the middle of each."""
        return self.time + self.dt / 2

    def _in_the_middle(self, value_at: Callable[[Recording, Array], Array | None]) -> Array | None:
        """What recordings say in the middle of each interval (K, ...); None unless all do."""
        out = None
        for r, recording in enumerate(self.dataset.recordings):
            rows = np.flatnonzero(self.recording == r)
            values = value_at(recording, self.middle[rows])
            if values is None:
                return None
            out = np.empty((len(self.time), values.shape[1])) if out is None else out
            out[rows] = values
        return out

    def take(self, rows: Array) -> "Intervals":
        """Some of the intervals, as often as they are asked for."""
        names = [f.name for f in fields(self) if f.name not in ("dataset", "states")]
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


def _groups(recordings: Sequence[Recording], states: Sequence[States]) -> list[ServoGroup]:
    """Recordings with a servo, in groups whose servos differ by their signals only."""
    begin, end = np.array([[r.angle.time[0], r.angle.time[-1]] for r in recordings]).T
    groups: dict[tuple[str, int], list[int]] = {}
    clock: dict[str, float] = {}
    for r, recording in enumerate(recordings):
        if recording.servo is not None:
            key = _settings(recording.servo)
            clock[key] = clock.get(key, 0.0) + end[r] - begin[r] + _APART
            groups.setdefault((key, int(clock[key] / _LONGEST)), []).append(r)
    out = []
    for members in groups.values():
        servos = [s for r in members if (s := recordings[r].servo) is not None]
        later = np.full(len(recordings), np.nan)
        spans = end[members] - begin[members] + _APART
        later[members] = begin[members[0]] + np.cumsum(spans) - spans - begin[members]
        where = begin[members], end[members], later[members]
        signals: dict[str, Any] = {
            f.name: on_one_clock([getattr(s, f.name) for s in servos], *where)
            for f in fields(Servo)
            if isinstance(getattr(servos[0], f.name), Signal)
        }
        angles = [recordings[r].angle for r in members]
        motion = _motion(angles, [states[r] for r in members], where)
        out.append(ServoGroup(replace(servos[0], **signals), motion, begin, end, later))
    return out


def _motion(
    angles: Sequence[Signal], states: Sequence[States], where: tuple[Array, Array, Array]
) -> ServoMotion:
    """The motion of recordings on one clock, without backlash."""
    clock, time = (
        np.concatenate([t + later for t, later in zip(times, where[-1], strict=True)])
        for times in ([a.time for a in angles], [s.time for s in states])
    )
    q, rate = (np.concatenate(x) for x in zip(*((s.q, s.w) for s in states), strict=True))
    dt = np.diff(time)[:, None]
    ends = rate[:-1] * dt, rate[1:] * dt
    curve = np.stack(ends, axis=-1) - np.diff(q, axis=0)[..., None]
    smooth = (Signal(s.time, s.q, "linear") for s in states)
    return ServoMotion(
        Signal(clock, np.concatenate([a.value for a in angles]), "linear"),
        on_one_clock([Signal(s.time, s.w, "linear") for s in states], *where),
        curve if np.array_equal(time, clock) else None,
        parts=tuple((a.time, q) for a, q in zip(angles, smooth, strict=True)),
    )


def _settings(servo: Servo) -> str:
    """All that alike servos have in common."""
    values = [getattr(servo, f.name) for f in fields(Servo)]
    return repr(
        [
            ("signal", v.hold) if isinstance(v, Signal) else np.asarray(v, object).tolist()
            for v in values
        ]
    )


def on_one_clock(signals: Sequence[Signal], begin: Array, end: Array, later: Array) -> Signal:
    """Signals one behind the other, each as much later, as they are from begin to end and near."""
    parts = []
    ends = np.stack([begin - 0.49 * _APART, end + 0.49 * _APART], axis=1)
    for signal, (low, high), shift in zip(signals, ends, later, strict=True):
        near = (signal.time > low) & (signal.time < high)
        first, last = sample(signal, [low, high])[:, None]
        time = np.concatenate([[low], signal.time[near], [high]])
        parts.append((time + shift, np.concatenate([first, signal.value[near], last])))
    time, value = map(np.concatenate, zip(*parts, strict=True))
    return Signal(time, value, signals[0].hold)


def intervals_of(dataset: Dataset, states: tuple[States, ...] | None = None) -> Intervals:
    """Intervals of a data set between the samples of its states; gaps are none of them.

    states : what the RTS smoother gives, where it has been asked before

    Raises
    ------
    InputError
        Where no recording has three intervals in one piece.
    """
    states = states or states_of(dataset, RTS(), None)
    parts = []
    for i, (recording, s) in enumerate(zip(dataset.recordings, states, strict=True)):
        dt = np.diff(s.time)
        whole = dt <= GAP * np.median(dt) if len(dt) else np.zeros(0, bool)
        measured, weight = _measured(recording.angle, s)
        columns = (
            *(s.time[:-1], dt, np.full(len(dt), i), np.arange(len(dt))),
            *(measured[:-1], measured[1:], weight[:-1], weight[1:], s.q[:-1], s.w[:-1]),
            np.concatenate([[False], whole])[:-1],
        )
        parts.append([x[whole] for x in columns])
    series = [np.concatenate(column) for column in zip(*parts, strict=True)]
    if len(series[0]) < 3:
        raise InputError(
            f"data set {dataset.name!r}: shooting needs recordings of at least 4 samples in one "
            f"piece; there are {len(series[0])} intervals in all"
        )
    return Intervals(dataset, tuple(states), *series)


def _measured(angle: Signal, states: States) -> tuple[Array, Array]:
    """Measured angles (T, n) and their relative weights at the times of the states.

    Those that the states leave out are the smoothed ones, without weight.
    """
    measured = sample(angle, states.time)
    weight = 1.0 / sample(angle._replace(value=relative_noise(angle)), states.time)
    if states.left_out is None:
        return measured, weight
    return np.where(states.left_out, states.q, measured), np.where(states.left_out, 0.0, weight)


def cut_windows(intervals: Intervals, use: Array, seconds: float) -> Array:
    """Windows (W, N) of about so many seconds, as indices of intervals, -1 behind their ends.

    use : (K,), intervals that may be used; windows do not cross others, or gaps

    Every unbroken run is divided into windows of nearly equal length, of at least 3 intervals.
    """
    index = np.flatnonzero(use)
    breaks = ~intervals.joined[index] | (np.diff(index, prepend=-2) != 1)
    windows: list[Array] = []
    for run in np.split(index, np.flatnonzero(breaks)[1:]):
        if len(run) >= 3:
            span = float(intervals.dt[run].sum())
            most = len(run) // 3
            windows += np.array_split(run, min(max(1, round(span / seconds)), most))
    if not windows:
        raise InputError(
            f"data set {intervals.dataset.name!r}: no three intervals in one piece are left to fit"
        )
    out = np.full((len(windows), max(map(len, windows))), -1)
    for row, window in zip(out, windows, strict=True):
        row[: len(window)] = window
    return out
