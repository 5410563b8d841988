"""Sensor faults: angles wrapped at a whole turn, and frozen readings of angles and torques.

A reading of a joint at rest and a held command repeat as well, so that repeated readings alone mean
nothing. An angle is frozen where the joint enters or leaves the interval with an acceleration that
no other moment comes near: a joint that comes to rest within a step does not. A torque is frozen
where, over the interval, the nominal balance of that joint, with friction as fitted to the other
windows, fails much worse than elsewhere, and by a good part of that torque. Where it fails
everywhere, something else is wrong: signs, units, joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.motion import MIN_WINDOWS, Measured, Motion, windows_of
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal
from frictionid.fitting.one_step.balances import Rows
from frictionid.fitting.one_step.torque_outliers import torque_outliers, with_torques_replaced

TURN = 2 * np.pi
READINGS = 5  # fewest equal readings
# Shortest frozen angle [s]; the joint enters or leaves it by this many times the noise or rounding,
# and by this many times the second difference that 99 % of the other samples stay below.
ANGLE, LEAP, JERK = 0.08, 6.0, 1.3
# Shortest frozen torque [s]; windows over which balances are taken [s].
TORQUE, WIDTH = 0.2, 0.07
# The residual within the interval is this many times that elsewhere, and this share of the torque's
# root mean square over all recordings; elsewhere it is at most that share. (Simulated: healthy
# intervals up to 3.0 times, frozen ones from 4.0 times, elsewhere up to 0.3; wrong angles from 2.)
WORSE, LARGE, FITS = 3.5, 0.4, 0.5


def unwrapped(dataset: Dataset) -> tuple[Dataset, list[Finding]]:
    """Data set without jumps of a whole turn, and a finding for each joint that had them.

    An angle is wrapped where it jumps by more than half a turn between neighbouring samples and
    yet never leaves a span of one turn.

    Examples
    --------
    >>> from frictionid.mechanics import pendulum
    >>> from frictionid.data.recordings import Recording
    >>> from frictionid.data.signals import Signal
    >>> time = np.arange(50) * 0.02
    >>> angle = (4.0 * time[:, None] + np.pi) % TURN - np.pi
    >>> recording = Recording("r", Signal(time, angle), Signal(time, 0 * angle))
    >>> wrapped = Dataset("a", pendulum(), (recording,))
    >>> mended, found = unwrapped(wrapped)
    >>> float(mended.recordings[0].angle.value[-1, 0].round(6)), found[0].kind
    (3.92, 'wrapped_angle')
    """
    span, jumps = _span(dataset), np.zeros(dataset.mechanism.n, int)
    turns = np.array([unit == "rad" for unit in dataset.mechanism.position_units])
    recordings = []
    for recording in dataset.recordings:
        value = recording.angle.value
        hits = (np.abs(np.diff(value, axis=0)) > np.pi) & (span <= TURN + 0.1) & turns
        if hits.any():
            jumps += hits.sum(0)
            mended = np.where(hits.any(0), np.unwrap(value, axis=0), value)
            recording = replace(recording, angle=recording.angle._replace(value=mended))
        recordings.append(recording)
    found = [
        Finding(
            "wrapped_angle",
            "unusable",
            f"angle {j + 1} jumps by a whole turn {jumps[j]} times: it is wrapped at half a turn",
            "unwrap it (numpy.unwrap) when the tables are written; all other checks unwrap it",
            int(j) + 1,
            {"jumps": float(jumps[j])},
        )
        for j in np.flatnonzero(jumps)
    ]
    return replace(dataset, recordings=tuple(recordings)), found


def _span(dataset: Dataset) -> Array:
    values = np.concatenate([r.angle.value for r in dataset.recordings])
    span: Array = np.ptp(values, axis=0)
    return span


class Frozen(NamedTuple):
    """Equal readings: recording, joint (from 0), start and stop [s], the reading."""

    recording: int
    joint: int
    start: float
    stop: float
    value: float

    @property
    def length(self) -> float:
        """Duration [s]."""
        return self.stop - self.start


def frozen_angles(measured: Measured) -> list[Frozen]:
    """Intervals in which an angle repeats although the joint must have moved."""
    bends = [np.diff(r.angle.value, n=2, axis=0) for r in measured.dataset.recordings]
    if not sum(map(len, bends)):
        return []
    usual = np.quantile(np.abs(np.concatenate(bends)), 0.99, axis=0)
    return [
        interval
        for i, motion in enumerate(measured.motions)
        for interval in _frozen_angles(i, measured.dataset.recordings[i].angle, motion, usual)
    ]


def _frozen_angles(number: int, angle: Signal, motion: Motion, usual: Array) -> list[Frozen]:
    """Frozen angles of one recording; usual (n,) : largest usual second difference [rad]."""
    out = []
    for j, a, b in _equal_readings(angle, ANGLE):
        column = np.asarray(angle.value)[:, j]
        if b - a + 1 == len(column):
            continue
        step = np.diff(column)
        quantum = np.abs(step[step != 0]).min()
        noise = LEAP * max(float(motion.angle_noise[j]), float(quantum))
        limit = max(noise, JERK * float(usual[j]))
        before = abs(column[a] - column[max(a - 1, 0)])
        behind = abs(column[min(b + 1, len(column) - 1)] - column[b])
        if before > limit or behind > limit:
            out.append(_interval(number, angle, j, a, b))
    return out


def frozen_torques(measured: Measured) -> list[Frozen]:
    """Intervals in which a torque repeats although the motion needs other torques."""
    intervals = [
        _interval(i, recording.torque, *place)
        for i, recording in enumerate(measured.dataset.recordings)
        for place in _equal_readings(recording.torque, TORQUE)
        if measured.mechanism.driven[place[0]]
    ]
    if not intervals:
        return []
    rows = windows_of(measured.balances, WIDTH)
    torque = rows.means(measured.torque)
    friction = torque - rows.required(measured.nominal)
    out = []
    for j in sorted({interval.joint for interval in intervals}):
        own = [interval for interval in intervals if interval.joint == j]
        level = float(np.sqrt(np.mean(torque[:, j] ** 2)))
        wrong = _contradicted(own, rows, friction, level)
        out += [interval for interval, is_wrong in zip(own, wrong, strict=True) if is_wrong]
    return out


def _equal_readings(signal: Signal, least: float) -> list[tuple[int, int, int]]:
    """Column, first and last sample of equal readings, `least` [s] and READINGS samples long."""
    time, out = np.asarray(signal.time), []
    for j, column in enumerate(np.asarray(signal.value).T):
        changes = np.flatnonzero(np.diff(column) != 0.0)
        first, last = np.append(0, changes + 1), np.append(changes, len(column) - 1)
        long = (last - first + 1 >= READINGS) & (time[last] - time[first] >= least)
        out += [(j, int(a), int(b)) for a, b in zip(first[long], last[long], strict=True)]
    return out


def _interval(number: int, signal: Signal, j: int, a: int, b: int) -> Frozen:
    time, value = signal.time, signal.value
    return Frozen(number, j, float(time[a]), float(time[b]), float(value[a, j]))


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
    return np.asarray((end > begin) & worse & testable & (elsewhere < FITS * level))


def _places(intervals: Sequence[Frozen], rows: Rows) -> tuple[Array, Array, Array, Array]:
    """Slices of rows (I,): first to last overlap an interval, begin to end lie within it."""
    places = []
    for one in intervals:
        here = slice(*np.searchsorted(rows.recording, [one.recording, one.recording + 1]))
        start, stop = rows.start[here], rows.stop[here]
        first = np.searchsorted(stop, one.start, side="right")
        last = max(np.searchsorted(start, one.stop, side="left"), first)
        begin = np.searchsorted(start, one.start, side="left")
        end = max(np.searchsorted(stop, one.stop, side="right"), begin)
        places.append(here.start + np.array([first, last, begin, end]))
    first, last, begin, end = np.array(places).T
    return first, last, begin, end


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
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / np.maximum(count, 1)))


def frozen_findings(
    measured: Measured, frozen: Sequence[Frozen], quantity: Literal["angle", "torque"]
) -> list[Finding]:
    """A finding for each joint with frozen angles or torques."""
    mechanism = measured.mechanism
    kind, units, contradiction = {
        "angle": ("frozen_sensor", mechanism.position_units, "the joint must move"),
        "torque": ("frozen_torque", mechanism.torque_units, "the motion needs others"),
    }[quantity]
    out = []
    for joint in sorted({f.joint for f in frozen}):
        own = [f for f in frozen if f.joint == joint]
        longest = max(own, key=lambda f: f.length)
        more = f", and {len(own) - 1} times more" if len(own) > 1 else ""
        name = measured.dataset.recordings[longest.recording].name
        out.append(
            Finding(
                kind,
                "doubtful",
                f"{quantity} {joint + 1} stands still at {longest.value:.3g} {units[joint]} for "
                f"{longest.length:.2g} s while {contradiction}, in {name!r} at "
                f"{longest.start:.3g} s{more}",
                "cut these intervals out, or record them again",
                joint + 1,
                {
                    "longest": longest.length,
                    "intervals": float(len(own)),
                    "value": longest.value,
                },
            )
        )
    return out


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
    names = [recording.name for recording in dataset.recordings]
    found = [*_findings("angle", angles, names), *_findings("torque", torques, names)]
    return measured.with_torques_of(with_torques_replaced(dataset, torques)), found


def _findings(quantity: str, masks: Sequence[Array], names: Sequence[str]) -> list[Finding]:
    out = []
    size = np.array([len(mask) for mask in masks])
    for j in range(masks[0].shape[1]):
        count = np.array([mask[:, j].sum() for mask in masks])
        count = np.where(count >= _SOME * size, count, 0)
        if not count.any():
            continue
        share = float(count.sum() / size[count > 0].sum())
        out.append(
            Finding(
                f"{quantity}_outliers",
                "doubtful" if share > _MANY else "good",
                f"{quantity} {j + 1} has {count.sum()} gross outliers, which fits leave out: "
                + _by_recording(count, names),
                "look for lost packets, wrong bits or a marker taken for another",
                j + 1,
                {"outliers": float(count.sum()), "share": share},
            )
        )
    return out


def _by_recording(count: Array, names: Sequence[str]) -> str:
    """Recordings with their counts, those with most first."""
    order = [int(i) for i in np.argsort(-count, kind="stable") if count[i]]
    text = ", ".join(f"{count[i]} in {names[i]!r}" for i in order[:_NAMED])
    more = order[_NAMED:]
    rest = f", and {int(count[more].sum())} in {len(more)} other recordings" if more else ""
    return text + rest
