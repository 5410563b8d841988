"""Sensor faults: wrapped angles, frozen readings, outliers, late and coarse velocities.

A reading of a joint at rest and a held command repeat as well, so that repeated readings alone mean
nothing. An angle is frozen where the joint enters or leaves the interval with an acceleration that
no other moment comes near: a joint that comes to rest within a step does not. A torque is frozen
where, over the interval, the nominal balance of that joint, with friction as fitted to the other
windows, fails much worse than elsewhere, and by a good part of that torque. Where it fails
everywhere, something else is wrong: signs, units, joints.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from frictionid.arrays import Array, rms
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal, sample, usual_intervals
from frictionid.data.state_estimators import States, resolution
from frictionid.fitting.one_step.balances import Rows
from frictionid.fitting.one_step.torque_outliers import torque_outliers, with_torques_replaced
from frictionid.fitting.shooting.data_checks import wraps

from .findings import Finding, finding
from .motion import MIN_WINDOWS, Measured, Motion, windows_of

READINGS = 5  # fewest equal readings
# Shortest frozen angle [s]; the joint enters or leaves it by this many times the noise or rounding,
# and by this many times the second difference that 99 % of the other samples stay below, of a short
# motion all but a few.
ANGLE, LEAP, JERK, FEW = 0.08, 6.0, 1.3, 5
AWAY = 2.0  # times the next step: what it went meanwhile
# Shortest frozen torque [s]; windows over which balances are taken [s].
TORQUE, WIDTH = 0.2, 0.07
# The residual within the interval is this many times that elsewhere, and this share of the torque's
# root mean square over all recordings; elsewhere it is at most that share. (Simulated: healthy
# intervals up to 3.0 times, frozen ones from 4.0 times, elsewhere up to 0.3; wrong angles from 2.)
WORSE, LARGE, FITS = 3.5, 0.4, 0.5


def unwrapped(dataset: Dataset) -> tuple[Dataset, list[Finding]]:
    """Data set without jumps of a whole turn, and a finding for each joint that had them.

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> from frictionid.data.recordings import Recording
    >>> from frictionid.data.signals import Signal
    >>> time = np.arange(50) * 0.02
    >>> angle = (4.0 * time[:, None] + np.pi) % (2 * np.pi) - np.pi
    >>> recording = Recording("r", Signal(time, angle), Signal(time, 0 * angle))
    >>> wrapped = Dataset("a", pendulum(), (recording,))
    >>> mended, findings = unwrapped(wrapped)
    >>> float(mended.recordings[0].angle.value[-1, 0].round(6)), findings[0].kind
    (3.92, 'wrapped_angle')
    """
    jumps, recordings = np.zeros(dataset.mechanism.n), []
    for recording, hits in zip(dataset.recordings, wraps(dataset), strict=True):
        jumps += hits.sum(0)
        value = recording.angle.value
        mended = np.where(hits.any(0), np.unwrap(value, axis=0), value)
        recordings.append(replace(recording, angle=recording.angle._replace(value=mended)))
    wrapped = [(int(j) + 1, {"jumps": float(jumps[j])}) for j in np.flatnonzero(jumps)]
    findings = [finding("wrapped_angle", numbers, joint=joint) for joint, numbers in wrapped]
    return replace(dataset, recordings=tuple(recordings)), findings


class Frozen(NamedTuple):
    """Equal readings: recording, joint (from 0), start and stop [s], the reading, its samples."""

    recording: int
    joint: int
    start: float
    stop: float
    value: float
    first: int
    last: int

    @property
    def length(self) -> float:
        """Duration [s]."""
        return self.stop - self.start


def frozen_angles(measured: Measured) -> list[Frozen]:
    """Intervals in which an angle repeats although the joint must have moved."""
    bends = [np.diff(r.angle.value, n=2, axis=0) for r in measured.dataset.recordings]
    if not sum(map(len, bends)):
        return []
    usual = np.array([_usual(column) for column in np.abs(np.concatenate(bends)).T])
    return [
        interval
        for i, motion in enumerate(measured.motions)
        for interval in _frozen_angles(i, measured.dataset.recordings[i].angle, motion, usual)
    ]


def _usual(bends: Array) -> float:
    """Size that 99 % of second differences (T,) in motion stay below, all but FEW of them at most.

    >>> round(_usual(np.append(np.zeros(9000), np.arange(1000.0))), 3)
    989.02
    """
    moving = bends[bends > 0]
    share = min(max(0.01, FEW / max(len(moving), 1)), 0.5)
    return float(np.quantile(moving, 1 - share)) if len(moving) else 0.0


def _frozen_angles(number: int, angle: Signal, motion: Motion, usual: Array) -> list[Frozen]:
    """Frozen angles of one recording; usual (n,) : largest usual second difference [rad]."""
    out = []
    for still in _equal_readings(number, angle, ANGLE):
        column = angle.value[:, still.joint]
        # what goes by in a gap of the stamps is no leap
        interval = np.diff(angle.time)
        step = np.diff(column) / np.maximum(interval / usual_intervals(interval), 1.0)
        if not step.any():
            continue
        quantum = np.abs(step[step != 0]).min()
        noise = LEAP * max(motion.angle_noise[still.joint], quantum)
        at = np.clip([still.first - 1, still.last, still.last + 1], 0, len(step) - 1)
        before, after, behind = np.abs(step[at])
        limit = max(noise, JERK * usual[still.joint])
        # a motion may start or stop at once, but neither both nor with what it went meanwhile
        if min(before, after) > limit or after > max(limit, AWAY * behind):
            out.append(still)
    return out


def frozen_torques(measured: Measured) -> list[Frozen]:
    """Intervals in which a torque repeats although the motion needs other torques."""
    intervals = [
        still
        for i, recording in enumerate(measured.dataset.recordings)
        for still in _equal_readings(i, recording.torque, TORQUE)
        if measured.mechanism.driven[still.joint]
    ]
    if not intervals:
        return []
    rows = windows_of(measured.balances, WIDTH)
    torque = rows.means(measured.torque)
    friction = torque - rows.required(measured.nominal)
    out = []
    for j in sorted({interval.joint for interval in intervals}):
        of_joint = [interval for interval in intervals if interval.joint == j]
        level = float(rms(torque[:, j]))
        wrong = _contradicted(of_joint, rows, friction, level)
        out += [interval for interval, is_wrong in zip(of_joint, wrong, strict=True) if is_wrong]
    return out


def _equal_readings(number: int, signal: Signal, least: float) -> list[Frozen]:
    """Equal readings of a recording, `least` [s] and READINGS samples long."""
    time, out = signal.time, []
    for j, column in enumerate(signal.value.T):
        changes = np.flatnonzero(np.diff(column) != 0.0)
        first, last = np.append(0, changes + 1), np.append(changes, len(column) - 1)
        long = (last - first + 1 >= READINGS) & (time[last] - time[first] >= least)
        for a, b in zip(first[long].tolist(), last[long].tolist(), strict=True):
            out.append(Frozen(number, j, float(time[a]), float(time[b]), float(column[a]), a, b))
    return out


def _contradicted(intervals: Sequence[Frozen], rows: Rows, friction: Array, level: float) -> Array:
    """Whether the motion contradicts these torques (I,) of one joint.

    friction (K, n) : what the balances leave to it ; level [N m] : root mean square of the torque

    All sums over rows are differences of cumulated ones, so that long recordings cost no more per
    interval than short ones.
    """
    j = intervals[0].joint
    use = rows.moving[:, j]
    table = np.column_stack([rows.shapes(j)[use], friction[use, j]])
    products = table[:, :, None] * table[:, None, :]
    sums = np.concatenate([np.zeros((1, *products.shape[1:])), np.cumsum(products, axis=0)])
    first, last, begin, end = _places(intervals, rows.where(use))
    inside, apart = sums[end] - sums[begin], sums[-1] - (sums[last] - sums[first])
    others = len(table) - (last - first)
    few = others < MIN_WINDOWS  # it never changes: the only question is whether it fits at all
    fitted = _fitted(np.where(few[:, None, None], inside, apart))
    left = _rms(inside, fitted, end - begin)
    elsewhere = np.where(few, 0.0, _rms(apart, fitted, others))
    worse = left > np.maximum(WORSE * elsewhere, LARGE * level)
    testable = np.array([interval.value != 0.0 for interval in intervals]) | ~few
    return (end > begin) & worse & testable & (elsewhere < FITS * level)


def _places(intervals: Sequence[Frozen], rows: Rows) -> Array:
    """Slices of rows (4, I): first to last overlap an interval, begin to end lie within it."""
    places = []
    for i in intervals:
        here = slice(*np.searchsorted(rows.recording, [i.recording, i.recording + 1]))
        start, stop = rows.start[here], rows.stop[here]
        first, end = (np.searchsorted(stop, t, side="right") for t in (i.start, i.stop))
        begin, last = (np.searchsorted(start, t, side="left") for t in (i.start, i.stop))
        places.append(here.start + np.array([first, max(last, first), begin, max(end, begin)]))
    return np.array(places).T


def _fitted(products: Array) -> Array:
    """Least squares (I, F + 1) by sums of products (I, F + 1, F + 1) of shapes and target.

    The last entry is the target's own, so that `_rms` gives what is left.
    """
    size = np.sqrt(np.diagonal(products, axis1=1, axis2=2)[:, :-1])
    size = np.where(size > 0, size, 1.0)
    scaled = products[:, :-1, :-1] / (size[:, :, None] * size[:, None, :])
    fitted = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True) @ (
        products[:, :-1, -1:] / size[:, :, None]
    )
    return np.concatenate([-fitted[..., 0] / size, np.ones((len(products), 1))], axis=1)


def _rms(products: Array, fitted: Array, count: Array) -> Array:
    squares = np.einsum("ia,iab,ib->i", fitted, products, fitted)
    return np.sqrt(np.maximum(squares, 0.0) / np.maximum(count, 1))


def frozen_findings(
    measured: Measured, frozen: Sequence[Frozen], code: Literal["frozen_sensor", "frozen_torque"]
) -> Iterator[Finding]:
    """A finding for each joint with frozen angles or torques."""
    mechanism = measured.mechanism
    is_angle = code == "frozen_sensor"
    units = mechanism.position_units if is_angle else mechanism.torque_units
    for joint in sorted({f.joint for f in frozen}):
        of_joint = [f for f in frozen if f.joint == joint]
        longest, count = max(of_joint, key=lambda f: f.length), len(of_joint)
        recording = measured.dataset.recordings[longest.recording]
        yield finding(
            code,
            {"longest": longest.length, "intervals": float(count), "value": longest.value},
            {
                "unit": units[joint],
                "recording": recording.name,
                "start": longest.start - recording.angle.time[0],
                "more": f", and {count - 1} times more" if count > 1 else "",
            },
            joint + 1,
        )


# Shares of a recording's samples: fewer are rough motion as likely as a glitch, more are doubtful.
_SOME, _MANY = 2e-3, 0.01
_NAMED = 4  # recordings at most


def without_outliers(measured: Measured) -> tuple[Measured, list[Finding]]:
    """The data without outliers of the torque, and a finding for each joint that has outliers.

    Of recordings in which no torque is frozen, before anything is corrected. The motions are
    without outliers of the angle already.
    """
    dataset, states = measured.dataset, [motion.states for motion in measured.motions]
    angles = [np.zeros(s.q.shape, bool) if s.left_out is None else s.left_out for s in states]
    torques = torque_outliers(dataset, measured.plant, states)
    masks = {"angle": angles, "torque": torques}
    findings = [f for name, mask in masks.items() for f in _outlier_findings(name, mask, dataset)]
    without = with_torques_replaced(dataset, torques)
    # where nothing was replaced, what is computed of the data already stays
    return measured if without is dataset else measured.with_torques_of(without), findings


def _outlier_findings(quantity: str, masks: Sequence[Array], dataset: Dataset) -> Iterator[Finding]:
    size = np.array([len(mask) for mask in masks])
    counts = np.array([mask.sum(0) for mask in masks])
    names = [recording.name for recording in dataset.recordings]
    for j, count in enumerate(np.where(counts >= _SOME * size[:, None], counts, 0).T):
        if not count.any():
            continue
        share = float(count.sum() / size[count > 0].sum())
        yield finding(
            "outliers",
            {"outliers": float(count.sum()), "share": share},
            {"quantity": quantity, "recordings": _by_recording(count, names)},
            j + 1,
            level="doubtful" if share > _MANY else "good",
            kind=f"{quantity}_outliers",
        )


def _by_recording(count: Array, names: Sequence[str]) -> str:
    """Recordings with their counts, those with most first."""
    order = [int(i) for i in np.argsort(-count, kind="stable") if count[i]]
    text = ", ".join(f"{count[i]} in {names[i]!r}" for i in order[:_NAMED])
    others = order[_NAMED:]
    if not others:
        return text
    return f"{text}, and {int(count[others].sum())} in {len(others)} other recordings"


# A velocity is late by this many standard errors and seconds at least; the search [s] and its step.
ERRORS, LATE, WIDEST, STEP = 4.0, 0.02, 0.5, 0.005
# It is another quantity where its size is off by this factor, or this share stays unexplained.
SIZE, UNLIKE = 1.25, 0.5
# A velocity is coarse whose steps are this share of its root mean square.
COARSE = 0.1


class Lag(NamedTuple):
    """A velocity against the smoothed angle's: lag, error [s], size, and what stays different."""

    seconds: float
    error: float
    size: float
    left: float


def velocity_findings(measured: Measured) -> Iterator[Finding]:
    """Findings of velocity columns that are late, no velocities of these angles, or coarse."""
    lags = {j: lag for j in range(measured.mechanism.n) if (lag := _lag(measured, j)) is not None}
    late = [
        j
        for j, lag in lags.items()
        if lag.left < UNLIKE and abs(lag.seconds) > max(LATE, ERRORS * lag.error)
    ]
    if late:
        seconds = float(np.median([lags[j].seconds for j in late]))
        words = {
            "joints": ", ".join(measured.mechanism.joints[j] for j in late),
            "size": abs(seconds),
            "word": "behind" if seconds > 0 else "ahead of",
        }
        yield finding("late_velocity", {"delay": seconds}, words, late[0] + 1)
    for j, lag in lags.items():
        unlike = lag.left > UNLIKE
        if j not in late and (unlike or not 1 / SIZE < lag.size < SIZE):
            code = "other_velocity" if unlike else "wrong_velocity"
            yield finding(code, {"size": lag.size, "left": lag.left}, joint=j + 1)
    yield from coarse_velocities(measured.dataset)


def coarse_velocities(dataset: Dataset) -> Iterator[Finding]:
    """A finding for each joint whose velocity comes in steps of a good part of its size."""
    logged = [r.velocity.value for r in dataset.recordings if r.velocity is not None]
    for j, value in enumerate(np.concatenate(logged).T if logged else ()):
        step, size = resolution(value), float(rms(value))
        if step > COARSE * size:
            words = {"unit": dataset.mechanism.position_units[j], "share": step / size}
            yield finding("coarse_velocity", {"step": step, "size": size}, words, j + 1)


def _lag(measured: Measured, j: int) -> Lag | None:
    """Least squares of the measured velocity on the delayed smoothed one, all recordings."""
    pairs = [
        (recording.velocity, motion.states)
        for recording, motion in measured.pairs
        if recording.velocity is not None and np.ptp(motion.states.time) > 4 * WIDEST
    ]
    if not pairs or not np.isfinite(measured.speeds.threshold[j]):
        return None
    lags = np.arange(-WIDEST, WIDEST + STEP / 2, STEP)
    sums = np.zeros((len(lags), 3))
    for velocity, states in pairs:
        sums += _products(velocity, states, j, lags)
    vv, vw, ww = sums.T
    if not (vv > 0).all() or not (ww > 0).all():
        return None
    left = 1 - vw * np.abs(vw) / (vv * ww)
    best = int(np.argmin(left))
    size, unlike = float(vw[best] / ww[best]), float(np.sqrt(max(left[best], 0.0)))
    if best in (0, len(lags) - 1):
        return Lag(0.0, np.inf, size, unlike)
    curve = max(left[best - 1] - 2 * left[best] + left[best + 1], 1e-300)
    shift = 0.5 * (left[best - 1] - left[best + 1]) / curve
    # a fifth of a second of samples agree with each other
    free = sum(float(np.ptp(states.time)) for _, states in pairs) / 0.2
    error = STEP * np.sqrt(2 * max(float(left[best]), 1e-12) / curve / max(free, 1.0))
    return Lag(float(lags[best] + STEP * shift), float(error), size, unlike)


def _products(velocity: Signal, states: States, j: int, lags: Array) -> Array:
    """Sums (D, 3) of v v, v w and w w with w delayed by each lag."""
    time = states.time
    inside = time[(time > time[0] + WIDEST) & (time < time[-1] - WIDEST)]
    v = sample(velocity, inside)[:, j]
    out = np.empty((len(lags), 3))
    for i, lag in enumerate(lags):
        w = np.interp(inside - lag, time, states.w[:, j])
        out[i] = v @ v, v @ w, w @ w
    return out
