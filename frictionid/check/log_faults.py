"""Faults of a log: repeated rows, stamps that jitter, dead currents, late or coarse velocities.

All show in the columns themselves, whatever the mechanism is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.clock import clock_findings
from frictionid.check.findings import Finding, percent
from frictionid.check.fine_structure import deviations, resolution
from frictionid.check.motion import Measured, Motion
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import sample

# Kinks at least; second differences around one are so many times those with the sign turned, and no
# reading is zero so many samples before or behind: what is cut off at zero is no size.
KINKS, STRAIGHTER, CLEAR = 3, 3.0, 4


def unsigned_torques(dataset: Dataset) -> list[Finding]:
    """A finding for each driven joint whose torque has lost its sign."""
    out = []
    for j in np.flatnonzero(dataset.mechanism.driven).tolist():
        columns = [np.asarray(r.torque.value)[:, j] for r in dataset.recordings]
        values = np.concatenate(columns)
        if not values.any() or values.min() < 0.0 < values.max():
            continue
        found = sum(len(kinks(np.abs(column))) for column in columns)
        if found >= KINKS:
            out.append(_finding(j, found))
    return out


def kinks(size: Array) -> Array:
    """Samples behind which a signal (T,) of one sign seems to have changed its sign.

    >>> time = np.arange(40) / 10.0
    >>> [kinks(np.abs(np.cos(2 * time))).tolist(), kinks(1.0 + np.cos(2 * time)).tolist()]
    [[7, 23], []]
    """
    first, before, a, b, behind, last = (size[k : len(size) - 5 + k] for k in range(6))
    bent = np.abs(before - 2 * a + b) + np.abs(a - 2 * b + behind)
    turned = np.abs(before - 2 * a - b) + np.abs(a + 2 * b - behind)
    falls = (first > before) & (before > a) & (b < behind) & (behind < last)
    places = np.flatnonzero(falls & (bent > STRAIGHTER * turned)) + 2
    zeros = np.append(0, np.cumsum(size == 0.0))
    stop = np.minimum(places + CLEAR + 2, len(size))
    return places[zeros[stop] == zeros[np.maximum(places - CLEAR, 0)]]


def _finding(j: int, found: int) -> Finding:
    return Finding(
        "unsigned_torque",
        "unusable",
        f"torque {j + 1} never changes its sign, and has a kink at zero {found} times where it "
        "would: its sign was not logged",
        "log the signed torque or current; nothing in the data gives the sign back",
        j + 1,
        {"kinks": float(found)},
    )


# Repeated rows of several joints are named from this share on, those of moving joints from this
# one; a joint moves that passes this many steps before and behind.
ROWS, HELD, STEPS = 0.01, 0.1, 3.0
# Stamps jitter by this share of the interval at least, and no stamp is off the even grid by more;
# on it the angles scatter less by this factor.
JITTER, EVEN, SMOOTHER = 0.01, 0.5, 0.9
# A torque is dead that is zero in this share of the samples in which its joint moves, and leaves
# zero for so many samples at a time only, so many times.
ZERO, SHORT, OFTEN = 0.5, 5, 10
# A velocity is late by this many standard errors and seconds at least; the search [s] and its step.
ERRORS, LATE, WIDEST, STEP = 4.0, 0.02, 0.5, 0.005
# It is another quantity where its size is off by this factor, or this share stays unexplained.
SIZE, UNLIKE = 1.25, 0.5
# A velocity is coarse whose steps are this share of its root mean square.
COARSE = 0.1
_MAD = 1.4826


def log_findings(measured: Measured, dead: Sequence[int]) -> list[Finding]:
    """Findings of all these faults; dead : joints with dead torques (from 0)."""
    dataset = measured.dataset
    return [
        *repeated_rows(dataset),
        *clock_findings(dataset),
        *jittering_stamps(dataset),
        *(_dead(measured, j) for j in dead),
        *unsigned_torques(dataset),
        *velocity_findings(measured),
        *coarse_velocities(dataset),
    ]


def repeated_rows(dataset: Dataset) -> list[Finding]:
    """A finding where rows repeat all angles of the row before.

    Around rest, readings in steps repeat. In motion, the log is faster than its sensors.
    """
    rows = moving = total = 0
    for recording in dataset.recordings:
        step = np.diff(np.asarray(recording.angle.value), axis=0)
        same: Array = np.all(step == 0.0, axis=1)
        # two rows on, or two back, an angle went by several of its steps: it moves
        quantum = np.array([np.abs(c[c != 0]).min(initial=np.inf) for c in step.T])
        fast: Array = np.any(np.abs(step) > STEPS * quantum, axis=1)
        near = np.zeros(len(same), dtype=bool)
        near[1:-1] = fast[:-2] & fast[2:]
        rows, moving = rows + int(same.sum()), moving + int((same & near).sum())
        total += len(same)
    if rows < ROWS * total or not total:
        return []
    share = percent(rows / total)
    of = f"{rows} of {total} rows repeat all angles of the row before"
    if moving > HELD * total:
        return [
            Finding(
                "repeated_rows",
                "doubtful",
                f"{of} ({share}) while joints move: the log is faster than its sensors",
                "keep one row of each reading (drop those that repeat)",
                None,
                {"rows": float(rows), "moving": float(moving)},
            )
        ]
    if dataset.mechanism.n < 2:
        return []  # equal readings of one angle are its steps
    return [
        Finding(
            "repeated_rows",
            "good",
            f"{of} ({share}), at rest and around reversals, where readings come in steps",
            "",
            None,
            {"rows": float(rows), "moving": float(moving)},
        )
    ]


def jittering_stamps(dataset: Dataset) -> list[Finding]:
    """A finding where stamps jitter and positions do not: on an even grid they are smoother."""
    found = [jitter for r in dataset.recordings if (jitter := _jitter(r)) is not None]
    if not found or len(found) < 0.5 * len(dataset.recordings):
        return []
    share, interval, ratio = (float(np.median(values)) for values in np.array(found).T)
    return [
        Finding(
            "jittering_stamps",
            "good",
            f"time stamps jitter by {percent(share)} of {1e3 * interval:.4g} ms, and the joints do "
            f"not: on an even grid the angles scatter {1 / ratio:.1f} times less",
            f"take row number times {interval:.5g} s as the time, if no row is missing",
            None,
            {"jitter": share, "interval": interval, "scatter": ratio},
        )
    ]


class Jitter(NamedTuple):
    """Jitter over the interval, mean interval [s], scatter on an even grid over that as given."""

    share: float
    interval: float
    scatter: float


def _jitter(recording: Recording) -> Jitter | None:
    time, value = np.asarray(recording.angle.time), np.asarray(recording.angle.value)
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
    scatter = []
    for clock in (time, even):
        off = deviations(clock, value)
        scatter.append([_scale(off[use[:, j], j]) for j in range(value.shape[1])])
    stamped, smooth = (np.array(own) for own in scatter)
    known = stamped > 0
    if not known.any():
        return None
    ratio = float(np.median(smooth[known] / stamped[known]))
    return Jitter(share, float(interval), ratio) if ratio < SMOOTHER else None


def _scale(values: Array) -> float:
    return float(_MAD * np.median(np.abs(values))) if len(values) else 0.0


def dead_torques(measured: Measured) -> list[int]:
    """Joints (from 0) whose torque is mostly zero while they move, but for readings here and there.

    A motor that is switched off is so for longer, and acts for longer.
    """
    threshold = measured.speeds.threshold
    out = []
    for j in np.flatnonzero(measured.mechanism.driven).tolist():
        zero, count, runs = 0, 0, []
        for recording, motion in zip(measured.dataset.recordings, measured.motions, strict=True):
            value = np.asarray(recording.torque.value)[:, j]
            moves = np.interp(
                recording.torque.time, motion.states.time, np.abs(motion.states.w[:, j])
            )
            use = moves > threshold[j]
            if not value.any():
                continue
            zero, count = zero + int((value[use] == 0.0).sum()), count + int(use.sum())
            runs += _lengths(value != 0.0)
        short = len(runs) >= OFTEN and float(np.mean(np.array(runs) <= SHORT)) > 0.8
        if count and zero >= ZERO * count and short:
            out.append(j)
    return out


def _lengths(flags: Array) -> list[int]:
    """Lengths of the runs of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [int(n) for n in edges[1::2] - edges[::2]]


def _dead(measured: Measured, j: int) -> Finding:
    values = [np.asarray(r.torque.value)[:, j] for r in measured.dataset.recordings]
    value = np.concatenate([v for v in values if v.any()])
    share, top = float((value == 0.0).mean()), float(np.abs(value).max())
    unit = measured.mechanism.torque_units[j]
    return Finding(
        "dead_torque",
        "unusable",
        f"torque {j + 1} is zero in {percent(share)} of the samples while the joint moves, and at "
        f"most {top:.2g} {unit}: its sensor shows nothing",
        "leave this joint out of [mechanism] joints (it stays locked), or record its torque; the "
        "other checks leave it out",
        j + 1,
        {"zero": share, "largest": top},
    )


class Lag(NamedTuple):
    """A velocity against the smoothed angle's: lag, error [s], size, and what stays different."""

    seconds: float
    error: float
    size: float
    left: float


def velocity_findings(measured: Measured) -> list[Finding]:
    """Findings of velocity columns that are late, or no velocities of these angles."""
    lags = [_lags(measured, j) for j in range(measured.mechanism.n)]
    known = [(j, lag) for j, lag in enumerate(lags) if lag is not None]
    late = [(j, lag) for j, lag in known if lag.left < UNLIKE and _is_late(lag)]
    wrong = [(j, lag) for j, lag in known if (j, lag) not in late and _is_other(lag)]
    return [*_late(late), *(_other(j, lag) for j, lag in wrong)]


def coarse_velocities(dataset: Dataset) -> list[Finding]:
    """A finding for each joint whose velocity comes in steps of a good part of its size."""
    logged = [r.velocity.value for r in dataset.recordings if r.velocity is not None]
    out = []
    for j, value in enumerate(np.concatenate(logged).T if logged else ()):
        step, size = resolution(value), float(np.sqrt(np.mean(value**2)))
        if step > COARSE * size:
            out.append(
                Finding(
                    "coarse_velocity",
                    "doubtful",
                    f"the velocity of joint {j + 1} comes in steps of {step:.2g} "
                    f"{dataset.mechanism.position_units[j]}/s ({percent(step / size)} of its root "
                    "mean square), as differences of encoder counts do",
                    "leave velocity out of [columns]: velocities are estimated from the angles",
                    j + 1,
                    {"step": step, "size": size},
                )
            )
    return out


def _is_late(lag: Lag) -> bool:
    return abs(lag.seconds) > max(LATE, ERRORS * lag.error)


def _is_other(lag: Lag) -> bool:
    return not 1 / SIZE < lag.size < SIZE or lag.left > UNLIKE


def _late(late: Sequence[tuple[int, Lag]]) -> Iterator[Finding]:
    if not late:
        return
    names = ", ".join(str(j + 1) for j, _ in late)
    seconds = float(np.median([lag.seconds for _, lag in late]))
    word = "behind" if seconds > 0 else "ahead of"
    yield Finding(
        "late_velocity",
        "doubtful",
        f"the velocity of joint{'s' * (len(late) > 1)} {names} is {abs(seconds):.2g} s {word} the "
        "angle's own, as of a low-pass filter",
        "leave velocity out of [columns]: velocities are estimated from the angles",
        late[0][0] + 1,
        {"delay": seconds},
    )


def _other(j: int, lag: Lag) -> Finding:
    what = (
        f"is {lag.size:.3g} times the angle's own"
        if lag.left <= UNLIKE
        else f"differs from the angle's own by {percent(lag.left)}"
    )
    return Finding(
        "wrong_velocity",
        "doubtful",
        f"the velocity of joint {j + 1} {what}: wrong column, sign or unit",
        "correct velocity in [columns] or [units], or leave it out",
        j + 1,
        {"size": lag.size, "left": lag.left},
    )


def _lags(measured: Measured, j: int) -> Lag | None:
    """Least squares of the measured velocity on the delayed smoothed one, all recordings."""
    pairs = [
        (recording, motion)
        for recording, motion in zip(measured.dataset.recordings, measured.motions, strict=True)
        if recording.velocity is not None and np.ptp(motion.states.time) > 4 * WIDEST
    ]
    if not pairs or not np.isfinite(measured.speeds.threshold[j]):
        return None
    lags = np.arange(-WIDEST, WIDEST + STEP / 2, STEP)
    sums = np.zeros((len(lags), 3))
    for recording, motion in pairs:
        sums += _products(recording, motion, j, lags)
    vv, vw, ww = sums.T
    if not (vv > 0).all() or not (ww > 0).all():
        return None
    left = 1 - vw * np.abs(vw) / (vv * ww)
    best = int(np.argmin(left))
    if best in (0, len(lags) - 1):
        return Lag(0.0, np.inf, float(vw[best] / ww[best]), float(np.sqrt(max(left[best], 0.0))))
    curve = left[best - 1] - 2 * left[best] + left[best + 1]
    shift = 0.5 * (left[best - 1] - left[best + 1]) / max(curve, 1e-300)
    # a fifth of a second of samples agree with each other
    free = sum(float(np.ptp(motion.states.time)) for _, motion in pairs) / 0.2
    error = STEP * np.sqrt(2 * max(float(left[best]), 1e-12) / max(curve, 1e-300) / max(free, 1.0))
    size, unlike = float(vw[best] / ww[best]), float(np.sqrt(max(left[best], 0.0)))
    return Lag(float(lags[best] + STEP * shift), float(error), size, unlike)


def _products(recording: Recording, motion: Motion, j: int, lags: Array) -> Array:
    """Sums (D, 3) of v v, v w and w w with w delayed by each lag."""
    assert recording.velocity is not None
    time = np.asarray(motion.states.time)
    inside = time[(time > time[0] + WIDEST) & (time < time[-1] - WIDEST)]
    v = sample(recording.velocity, inside)[:, j]
    out = np.empty((len(lags), 3))
    for i, lag in enumerate(lags):
        w = np.interp(inside - lag, time, motion.states.w[:, j])
        out[i] = v @ v, v @ w, w @ w
    return out
