"""Faults of a log that its columns show, and of its unit of time, by the nominal mechanism.

Rows that repeat, stamps that jitter, come in bursts or leave gaps; torques that are dead, held, or
without their sign.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.data.readers.column_toml import counts_of
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import GAP, Signal, run_edges, usual_intervals

from .conventions import MARGIN, log_unexplained
from .facts import deviations, scatter_of
from .findings import Finding, finding
from .motion import Measured, motions_of

# Kinks at least; second differences around one are so many times those with the sign turned, and no
# reading is zero so many samples before or behind: what is cut off at zero is no size.
KINKS, STRAIGHTER, CLEAR = 3, 3.0, 4
# Repeated rows of several joints are named from this share on, those of moving joints from this
# one; a joint moves that passes this many steps before and behind.
ROWS, HELD, STEPS = 0.01, 0.1, 3.0
# Stamps jitter by this share of the interval at least, and no stamp is off the even grid by more;
# on it the angles scatter less by this factor.
JITTER, EVEN, SMOOTHER = 0.01, 0.5, 0.9
# A torque is dead that is zero in this share of the samples in which its joint moves, and leaves
# zero for so many samples at a time only, so many times.
ZERO, SHORT, OFTEN = 0.5, 5, 10
# Stamps come in bursts where so many follow the one before within this share of the interval.
BURSTS, CLOSE = 5, 0.1
# A torque is held whose values stay for one number of rows, this many at most, in this share of its
# changes, of which there are so many.
MOST_ROWS, SAME, CHANGES = 10, 0.9, 50
# A joint jumps that moves so many times farther in one interval than in its fast ones, of which
# this share is slower, and than in so many before and behind.
JUMP, FAST, AROUND = 5.0, 0.99, 3


def log_findings(measured: Measured, dead: Sequence[int]) -> Iterator[Finding]:
    """Findings of all these faults; dead : joints with dead torques (from 0)."""
    dataset = measured.dataset
    yield from repeated_rows(dataset)
    yield from clock_findings(dataset)
    yield from jittering_stamps(dataset)
    yield from jumping_angles(dataset)
    yield from (_dead(measured, j) for j in dead)
    yield from unsigned_torques(dataset)


def count_findings(dataset: Dataset) -> Iterator[Finding]:
    """A finding where angles that were read as rad or deg look like counts of an encoder."""
    angles = np.concatenate([np.ravel(r.angle.value) for r in dataset.recordings])
    for unit, columns in (("rad", angles), ("deg", np.degrees(angles))):
        if keys := counts_of(columns):
            yield finding("counts", keys, {"unit": unit})


def _torques(dataset: Dataset, j: int) -> list[Array]:
    """Torque (T,) of joint j in each recording."""
    return [r.torque.value[:, j] for r in dataset.recordings]


def unsigned_torques(dataset: Dataset) -> Iterator[Finding]:
    """A finding for each driven joint whose torque has lost its sign."""
    for j in dataset.driven_joints:
        columns = _torques(dataset, j)
        values = np.concatenate(columns)
        if not values.any() or values.min() < 0.0 < values.max():
            continue
        count = sum(len(kinks(np.abs(column))) for column in columns)
        if count >= KINKS:
            yield finding("unsigned_torque", {"kinks": float(count)}, joint=j + 1)


def kinks(size: Array) -> Array:
    """Samples behind which a signal (T,) of one sign seems to have changed its sign.

    >>> time = np.arange(40) / 10.0
    >>> [kinks(np.abs(np.cos(2 * time))).tolist(), kinks(1.0 + np.cos(2 * time)).tolist()]
    [[7, 23], []]
    """
    count = max(len(size) - 5, 0)
    first, before, a, b, behind, last = (size[k : k + count] for k in range(6))
    bent = np.abs(before - 2 * a + b) + np.abs(a - 2 * b + behind)
    turned = np.abs(before - 2 * a - b) + np.abs(a + 2 * b - behind)
    falls = (first > before) & (before > a) & (b < behind) & (behind < last)
    places = np.flatnonzero(falls & (bent > STRAIGHTER * turned)) + 2
    zeros = np.append(0, np.cumsum(size == 0.0))
    stop = np.minimum(places + CLEAR + 2, len(size))
    return places[zeros[stop] == zeros[np.maximum(places - CLEAR, 0)]]


def repeated_rows(dataset: Dataset) -> Iterator[Finding]:
    """A finding where rows repeat all angles of the row before.

    Around rest, readings in steps repeat. In motion, the log is faster than its sensors.
    """
    rows = moving = total = 0
    for recording in dataset.recordings:
        step = np.diff(recording.angle.value, axis=0)
        same: Array = np.all(step == 0.0, axis=1)
        # before and behind equal readings an angle goes by several of its steps: it moves
        quantum = np.array([np.abs(c[c != 0]).min(initial=np.inf) for c in step.T])
        fast: Array = np.any(np.abs(step) > STEPS * quantum, axis=1)
        change = np.flatnonzero(~same)
        held = np.diff(change) - 1
        held = held[fast[change[:-1]] & fast[change[1:]] & (held < MOST_ROWS)]
        rows, moving = rows + int(same.sum()), moving + int(held.sum())
        total += len(same)
    if rows < ROWS * total or not total:
        return
    in_motion = moving > HELD * total
    if in_motion or dataset.mechanism.n > 1:  # equal readings of one angle are its steps
        yield finding(
            "repeated_rows" if in_motion else "repeated_rows_at_rest",
            {"rows": float(rows), "moving": float(moving)},
            {"total": total, "share": rows / total},
        )


def jittering_stamps(dataset: Dataset) -> Iterator[Finding]:
    """A finding where stamps jitter and positions do not: on an even grid they are smoother."""
    jitters = [jitter for r in dataset.recordings if (jitter := _jitter(r)) is not None]
    if not jitters or len(jitters) < 0.5 * len(dataset.recordings):
        return
    share, interval, ratio = (float(np.median(values)) for values in zip(*jitters, strict=True))
    yield finding(
        "jittering_stamps",
        {"jitter": share, "interval": interval, "scatter": ratio},
        {"times": 1 / ratio},
    )


def _jitter(recording: Recording) -> tuple[float, float, float] | None:
    """Jitter over the interval, mean interval [s], scatter on an even grid over that as logged."""
    time, value = recording.angle.time, recording.angle.value
    rows = np.arange(len(time))
    if len(time) < 100:
        return None
    interval, start = np.polyfit(rows, time, 1)
    even = start + interval * rows
    share = float(np.std(np.diff(time)) / interval)
    if share < JITTER or np.abs(time - even).max() > EVEN * interval:
        return None
    # faster samples show it: an error of the time is an angle there
    speed = np.abs(np.gradient(value, even, axis=0))[2:-2]
    use = speed > np.quantile(speed, 0.5, axis=0)
    stamped, smooth = (
        np.array([scatter_of(column[u]) for column, u in zip(off.T, use.T, strict=True)])
        for off in (deviations(time, value), deviations(even, value))
    )
    scatters = stamped > 0
    if not scatters.any():
        return None
    ratio = float(np.median(smooth[scatters] / stamped[scatters]))
    return (share, float(interval), ratio) if ratio < SMOOTHER else None


def dead_torques(measured: Measured) -> list[int]:
    """Joints (from 0) whose torque is mostly zero while they move, but for readings here and there.

    A motor that is switched off is so for longer, and acts for longer.
    """
    threshold = measured.speeds.threshold
    out = []
    for j in measured.dataset.driven_joints:
        zero, count, lengths = 0, 0, np.zeros(0)
        for recording, motion in measured.pairs:
            value = recording.torque.value[:, j]
            if not value.any():
                continue
            speed = np.abs(motion.states.w[:, j])
            use = np.interp(recording.torque.time, motion.states.time, speed) > threshold[j]
            zero, count = zero + int((value[use] == 0.0).sum()), count + int(use.sum())
            first, stop = run_edges(value != 0.0)
            lengths = np.append(lengths, stop - first)
        short = len(lengths) >= OFTEN and np.mean(lengths <= SHORT) > 0.8
        if count and zero >= ZERO * count and short:
            out.append(j)
    return out


def _dead(measured: Measured, j: int) -> Finding:
    value = np.concatenate([column for column in _torques(measured.dataset, j) if column.any()])
    share, top = float((value == 0.0).mean()), float(np.abs(value).max())
    unit = measured.mechanism.torque_units[j]
    return finding("dead_torque", {"zero": share, "largest": top}, {"unit": unit}, j + 1)


def clock_findings(dataset: Dataset) -> Iterator[Finding]:
    """Findings of gaps and bursts of the stamps, and of torques that are held over rows."""
    gaps = _stamps(dataset, lambda interval: interval > GAP * usual_intervals(interval))
    if gaps:
        longest, start, name = max(gaps)
        count = len(gaps)
        many = f"{count} gaps in the time stamps, the longest" if count > 1 else "a gap"
        numbers = {"gaps": float(count), "longest": longest, "start": start}
        yield finding("stamp_gaps", numbers, {"many": many, "recording": name})
    bursts = _stamps(dataset, lambda interval: interval < CLOSE * np.median(interval))
    if len(bursts) >= BURSTS:
        _, start, name = bursts[0]
        numbers = {"rows": float(len(bursts)), "start": start}
        yield finding("stamp_bursts", numbers, {"recording": name})
    for j in dataset.driven_joints:
        rows = _held_rows(_torques(dataset, j))
        if rows > 1:
            words = {"repeats": 1 - 1 / rows}
            yield finding("held_torque", {"rows": float(rows)}, words, j + 1)


def jumping_angles(dataset: Dataset) -> Iterator[Finding]:
    """A finding for each joint that is elsewhere in the next sample, as where two runs are one."""
    for j, unit in enumerate(dataset.mechanism.position_units):
        jumps = [
            (size, float(r.angle.time[k] - r.angle.time[0]), r.name)
            for r in dataset.recordings
            for k, size in _jumps(r.angle, j)
        ]
        if jumps:
            size, start, name = max(jumps)
            numbers = {"jumps": float(len(jumps)), "largest": size, "start": start}
            yield finding("jumping_angle", numbers, {"unit": unit, "recording": name}, j + 1)


def _jumps(angle: Signal, j: int) -> list[tuple[int, float]]:
    """Samples behind which an angle of a joint jumps, and how far.

    But for the end of a standstill, where it may be the sensor that was frozen.
    """
    interval, step = np.diff(angle.time), np.abs(np.diff(angle.value[:, j]))
    if len(step) <= 2 * AROUND:
        return []
    even = interval <= GAP * usual_intervals(interval)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(step, AROUND), 2 * AROUND + 1)
    before, behind = around[:, :AROUND].max(axis=1), around[:, AROUND + 1 :].max(axis=1)
    frozen = (before == 0) & (behind > 0)
    usual = np.maximum(np.quantile(step[even], FAST), np.maximum(before, behind))
    at = np.flatnonzero(even & ~frozen & (usual > 0) & (step > JUMP * usual))
    return [(int(k), float(step[k])) for k in at]


def _stamps(dataset: Dataset, chosen: Callable[[Array], Array]) -> list[tuple[float, float, str]]:
    """Chosen intervals between stamps [s], when they begin [s] from the first, their recordings."""
    out = []
    for recording in dataset.recordings:
        time = recording.angle.time
        interval = np.diff(time)
        at = np.flatnonzero(chosen(interval)) if len(interval) else ()
        out += [(float(interval[k]), float(time[k] - time[0]), recording.name) for k in at]
    return out


def _held_rows(columns: Sequence[Array]) -> int:
    """Rows for which a torque keeps each of its values, 0 where it is not held."""
    runs = np.concatenate([np.diff(np.flatnonzero(np.diff(column))) for column in columns])
    rows = int(np.median(runs)) if len(runs) else 0
    held = rows <= MOST_ROWS and len(runs) >= CHANGES and np.mean(runs == rows) >= SAME
    return rows if held else 0


# --- Unit of time ---------------------------------------------------------------------------------


# [s] between samples of angles: machines are sampled 5 to 5000 times a second, which leaves one
# unit of time to compare with the one of the table.
SHORTEST, LONGEST = 1.99e-4, 0.199
# Seconds of the true unit, in that of the table, and what the table then says.
UNITS = {
    1e-3: "the time is in ms, not in s",
    1e-6: "the time is in us, not in s",
    1e3: "the time is 1000 times too short: in s, not in ms",
    1e6: "the time is 1e6 times too short: in s, not in us",
}


def in_seconds(dataset: Dataset) -> tuple[Dataset, list[Finding]]:
    """Data set with times in seconds, and a finding where those of the tables are not.

    Examples
    --------
    >>> time = np.arange(300) / 60
    >>> fast = Signal(1000 * time, np.cos(5.7 * time)[:, None])
    >>> machine = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.3}}
    >>> swing = Recording("swing", fast, Signal(1000 * time, np.zeros((300, 1))))
    >>> in_seconds(Dataset("demo", machine, (swing,)))[1][0].text.partition(":")[0]
    'the time is in ms, not in s'
    """
    steps = [np.diff(r.angle.time) for r in dataset.recordings if len(r.angle.time) > 1]
    interval = float(np.median(np.concatenate(steps))) if steps else 0.0
    fitting = [f for f in (1.0, *UNITS) if SHORTEST <= interval * f < LONGEST]
    if not fitting or fitting[0] == 1.0:
        return dataset, []
    factor = fitting[0]

    def clocked(signal: Signal) -> Signal:
        return signal._replace(time=factor * signal.time)

    recordings = tuple(r.changed(clocked, clocked) for r in dataset.recordings)
    corrected = replace(dataset, recordings=recordings)
    measured = Measured.of_dataset(corrected, motions_of(corrected.recordings))
    rows = measured.rows.at(measured.nominal)
    torque = rows.means(measured.torque)
    # with the times of the table, then with the corrected ones
    before, score = (
        log_unexplained(rows._replace(inertia=f**2 * rows.inertia), torque) for f in (factor, 1.0)
    )
    if not score < before - MARGIN:
        return dataset, []
    numbers = {"factor": factor, "interval": interval, "score": score, "given": before}
    words = {"unit": UNITS[factor], "actual": factor * interval}
    return corrected, [finding("time_unit", numbers, words)]
