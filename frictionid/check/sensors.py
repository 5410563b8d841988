"""Faults of an angle sensor: jumps of a whole turn, and readings that stand still."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.motion import Motion
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal

TURN = 2 * np.pi
# A reading is frozen where it repeats for at least this long [s] and this many samples ...
STILL, SAMPLES = 0.08, 5
# ... while the joint came in or went out with this many times the step of noise or rounding.
LEAP = 6.0


def unwrapped(dataset: Dataset) -> tuple[Dataset, list[Finding]]:
    """Data set without jumps of a whole turn, and a finding for each joint that had them.

    An angle is wrapped where it jumps by more than half a turn between neighbouring samples and
    yet never leaves a span of one turn.

    Examples
    --------
    >>> from frictionid.data.recordings import Recording
    >>> from frictionid.data.signals import Signal
    >>> time = np.arange(50) * 0.02
    >>> angle = (4.0 * time[:, None] + np.pi) % TURN - np.pi
    >>> wrapped = Dataset("a", {}, (Recording("r", Signal(time, angle), Signal(time, 0 * angle)),))
    >>> mended, found = unwrapped(wrapped)
    >>> float(mended.recordings[0].angle.value[-1, 0].round(6)), found[0].kind
    (3.92, 'wrapped_angle')
    """
    span = _span(dataset)
    jumps = np.zeros(len(span), int)
    recordings = []
    for recording in dataset.recordings:
        value = recording.angle.value
        hits = (np.abs(np.diff(value, axis=0)) > np.pi) & (span <= TURN + 0.1)
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
            "unwrap it (numpy.unwrap) when the tables are written; checked on as if it were",
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


class Stretch(NamedTuple):
    """A reading that stands still: recording, joint (from 0), start [s] and length [s]."""

    recording: int
    joint: int
    start: float
    length: float


def frozen(dataset: Dataset, motions: Sequence[Motion]) -> tuple[list[Finding], set[int]]:
    """Findings of readings that repeat while the joint must have moved, and the recordings."""
    stretches = [
        stretch
        for i, motion in enumerate(motions)
        for stretch in _stretches(i, dataset.recordings[i].angle, motion)
    ]
    found = []
    for joint in sorted({s.joint for s in stretches}):
        own = [s for s in stretches if s.joint == joint]
        worst = max(own, key=lambda s: s.length)
        name = dataset.recordings[worst.recording].name
        more = f", and {len(own) - 1} times more" if len(own) > 1 else ""
        found.append(
            Finding(
                "frozen_sensor",
                "doubtful",
                f"angle {joint + 1} stands still for {worst.length:.2g} s while it must move, in "
                f"{name!r} at {worst.start:.3g} s{more}",
                "cut these stretches out, or record them again",
                joint + 1,
                {"longest": worst.length, "stretches": float(len(own))},
            )
        )
    return found, {s.recording for s in stretches}


def _stretches(number: int, angle: Signal, motion: Motion) -> list[Stretch]:
    time, value = np.asarray(angle.time), np.asarray(angle.value)
    out = []
    for j, column in enumerate(value.T):
        step = np.diff(column)
        for a, b in _runs(step == 0.0):
            # samples a ... b are equal
            if b - a + 1 < SAMPLES or time[b] - time[a] < STILL or b - a + 1 == len(column):
                continue
            quantum = np.abs(step[step != 0]).min()
            limit = LEAP * max(float(motion.angle_noise[j]), float(quantum))
            before = abs(column[a] - column[max(a - 2, 0)])
            behind = abs(column[min(b + 1, len(column) - 1)] - column[b])
            if before > limit or behind > limit:
                out.append(Stretch(number, j, float(time[a]), float(time[b] - time[a])))
    return out


def _runs(flags: Array) -> list[tuple[int, int]]:
    """First and last sample of each stretch of equal readings, from flags between samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
