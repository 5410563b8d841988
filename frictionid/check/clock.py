"""Unit of time: milliseconds, microseconds or seconds that were read as another of these.

A time that is f times too long makes accelerations f^2 times too small and leaves gravity, friction
and the torque as they are, so that one set of balances shows which unit the mechanism moves in.
Machines are sampled 5 to 5000 times a second: that leaves one unit to compare with the given one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictionid.arrays import Array
from frictionid.check.conventions import MARGIN, log_unexplained
from frictionid.check.facts import GAP, usual_intervals
from frictionid.check.findings import Finding, percent
from frictionid.check.motion import Measured, Motion, motions_of, windows_of
from frictionid.data.recordings import Dataset, Recording, TrueMotion
from frictionid.data.signals import Signal
from frictionid.fitting.one_step.balances import Rows

SHORTEST, LONGEST = 1.99e-4, 0.199  # [s] between samples of angles
# Seconds of the true unit, in the given one, and what the table then says.
UNITS = {
    1e-3: "the time is in ms, not in s",
    1e-6: "the time is in us, not in s",
    1e3: "the time is 1000 times too short: in s, not in ms",
    1e6: "the time is 1e6 times too short: in s, not in us",
}


def in_seconds(dataset: Dataset) -> tuple[Dataset, list[Finding]]:
    """Data set with times in seconds, and a finding where the given ones are not.

    Examples
    --------
    >>> time = np.arange(300) / 60
    >>> fast = Signal(1000 * time, np.cos(5.7 * time)[:, None])
    >>> machine = {"kind": "pendulum", "parameters": {"mass": 1.0, "length": 0.3}}
    >>> swing = Recording("swing", fast, Signal(1000 * time, np.zeros((300, 1))))
    >>> in_seconds(Dataset("demo", machine, (swing,)))[1][0].text.partition(":")[0]
    'the time is in ms, not in s'
    """
    interval = _interval(dataset)
    if SHORTEST <= interval < LONGEST:
        return dataset, []
    fitting = [f for f in UNITS if SHORTEST <= interval * f < LONGEST]
    if not fitting:
        return dataset, []
    factor = fitting[0]
    corrected = _scaled(dataset, factor)
    measured = Measured.of(corrected, motions_of(corrected.recordings))
    rows = windows_of(measured.balances).at(measured.nominal)
    given, found = (_score(one, rows, measured) for one in (factor, 1.0))
    if not found < given - MARGIN:
        return dataset, []
    return corrected, [_finding(factor, interval, given, found)]


def _interval(dataset: Dataset) -> float:
    """Usual time [s] between two samples of the angles."""
    steps = [np.diff(r.angle.time) for r in dataset.recordings if len(r.angle.time) > 1]
    return float(np.median(np.concatenate(steps))) if steps else 0.0


def _score(factor: float, rows: Rows, measured: Measured) -> float:
    """Mean log of the unexplained share, see `log_unexplained`, for times 1 / factor as long."""
    scaled = rows._replace(inertia=factor**2 * rows.inertia)
    return float(log_unexplained(scaled, rows.means(measured.torque)).mean())


def _scaled(dataset: Dataset, factor: float) -> Dataset:
    return replace(dataset, recordings=tuple(_in(factor, r) for r in dataset.recordings))


def _in(factor: float, recording: Recording) -> Recording:
    def scaled(signal: Signal) -> Signal:
        return signal._replace(time=factor * signal.time)

    truth, velocity = recording.truth, recording.velocity
    return replace(
        recording,
        angle=scaled(recording.angle),
        torque=scaled(recording.torque),
        velocity=velocity and scaled(velocity),
        covariates={key: scaled(signal) for key, signal in recording.covariates.items()},
        truth=truth and TrueMotion(scaled(truth.angle), scaled(truth.velocity)),
    )


def _finding(factor: float, interval: float, given: float, found: float) -> Finding:
    left = [percent(float(np.exp(score / 2))) for score in (found, given)]
    return Finding(
        "time_unit",
        "unusable",
        f"{UNITS[factor]}: samples {interval:.3g} s apart are {1e3 * factor * interval:.3g} ms "
        f"apart, and the nominal mechanism leaves {left[0]} of the torque unexplained instead of "
        f"{left[1]}",
        'correct time = "ms" (or "us", "s") under [units] of dataset.toml; the other checks use '
        "corrected data",
        None,
        {"factor": factor, "interval": interval, "score": found, "given": given},
    )


# Velocity changes from sample to sample over the fast speed: beyond it samples are too few.
COARSE = 0.1


def sampling_findings(measured: Measured) -> list[Finding]:
    """A finding where the velocity of a joint changes much between two samples."""
    threshold, fast = measured.speeds
    change = velocity_changes(measured.motions, threshold) / fast
    j = int(np.argmax(change))
    if change[j] <= COARSE:
        return []
    gap = np.median(np.concatenate([np.diff(motion.states.time) for motion in measured.motions]))
    return [
        Finding(
            "slow_sampling",
            "doubtful",
            f"velocity {j + 1} changes by {percent(change[j])} of its fast speed from one sample "
            f"to the next, {1e3 * gap:.3g} ms later: what happens between them is lost, and "
            "one-step fits are wrong",
            f"sample {np.ceil(2 * change[j] / COARSE):.0f} times as often, or move slower; "
            "shooting is harmed less",
            j + 1,
            {"change": float(change[j])},
        )
    ]


def velocity_changes(motions: Sequence[Motion], threshold: Array) -> Array:
    """Usual change (n,) [rad/s] of velocities from sample to sample; zero for joints at rest.

    Median over the samples with a speed above the threshold (n,) [rad/s].
    """
    change = np.concatenate([np.abs(np.diff(motion.states.w, axis=0)) for motion in motions])
    speed = np.concatenate([np.abs(motion.states.w[1:]) for motion in motions])
    moving = [own[s > least] for own, s, least in zip(change.T, speed.T, threshold, strict=True)]
    return np.array([np.median(own) if len(own) else 0.0 for own in moving])


# Stamps come in bursts where so many follow the one before within this share of the interval.
BURSTS, CLOSE = 5, 0.1
# A torque is held whose values stay for one number of rows, this many at most, in this share of its
# changes, of which there are so many.
ROWS, SAME, CHANGES = 10, 0.9, 50


def clock_findings(dataset: Dataset) -> list[Finding]:
    """Findings of all these faults."""
    joints = np.flatnonzero(dataset.mechanism.driven).tolist()
    return [
        *_gaps(dataset),
        *_bursts(dataset),
        *(found for j in joints if (found := _held(dataset, j)) is not None),
    ]


def _gaps(dataset: Dataset) -> list[Finding]:
    """A finding on gaps, with the longest one."""
    found = []
    for recording in dataset.recordings:
        time = np.asarray(recording.angle.time)
        interval = np.diff(time)
        at = np.flatnonzero(interval > GAP * usual_intervals(interval))
        found += [(float(interval[k]), float(time[k]), recording.name) for k in at]
    if not found:
        return []
    longest, start, name = max(found)
    many = f"{len(found)} gaps in the time stamps, the longest" if len(found) > 1 else "a gap"
    return [
        Finding(
            "stamp_gaps",
            "good",
            f"{many} of {longest:.2g} s after {start:.4g} s of {name!r}; no fit goes across a gap",
            "look for lost packets",
            None,
            {"gaps": float(len(found)), "longest": longest, "start": start},
        )
    ]


def _bursts(dataset: Dataset) -> list[Finding]:
    """A finding where rows are stamped as they arrived, many at once."""
    found = []
    for recording in dataset.recordings:
        time = np.asarray(recording.angle.time)
        interval = np.diff(time)
        at = np.flatnonzero(interval < CLOSE * np.median(interval)) if len(interval) else ()
        found += [(float(time[k]), recording.name) for k in at]
    if len(found) < BURSTS:
        return []
    start, name = found[0]
    return [
        Finding(
            "stamp_bursts",
            "doubtful",
            f"{len(found)} rows are stamped less than a tenth of the usual interval after the row "
            f"before, first at {start:.4g} s of {name!r}: when they arrived, not when they were "
            "measured",
            "log the time of the sensor, or leave these spans out by start and stop in "
            "[recordings]",
            None,
            {"rows": float(len(found)), "start": start},
        )
    ]


def _held(dataset: Dataset, j: int) -> Finding | None:
    """A finding where a torque keeps each value for the same number of rows."""
    runs: list[int] = []
    for recording in dataset.recordings:
        value = np.asarray(recording.torque.value)[:, j]
        runs += np.diff(np.flatnonzero(np.diff(value))).tolist()
    rows = int(np.median(runs)) if runs else 0
    if not 1 < rows <= ROWS or len(runs) < CHANGES or np.mean(np.array(runs) == rows) < SAME:
        return None
    return Finding(
        "held_torque",
        "good",
        f"torque {j + 1} changes in one of {rows} rows ({percent(1 - 1 / rows)} of them repeat "
        "it): it is measured or commanded more slowly than it is logged",
        "nothing where the drive holds it so; of a sensor's readings keep the rows in which it "
        "changes, with a time column of their own, or fit the delay",
        j + 1,
        {"rows": float(rows)},
    )
