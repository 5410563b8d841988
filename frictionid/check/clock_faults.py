"""Faults of clocks: gaps and bursts of time stamps, torques that are held over several rows.

All show in the columns themselves, whatever the mechanism is.
"""

from __future__ import annotations

import numpy as np

from frictionid.check.facts import GAP, usual_intervals
from frictionid.check.findings import Finding, percent
from frictionid.data.recordings import Dataset

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
