"""Torque readings that stand still while the motion asks for other torques.

A held command repeats as well, so that repeated readings alone say nothing. Over a stretch in which
torque j repeats, the told mechanism's balance of joint j, with friction as the other windows show
it, must fail much worse than elsewhere, and by a good part of that torque. Where it fails
everywhere, something else is wrong: signs, units, joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import FEWEST, Rows, unit_rows
from frictionid.check.findings import Finding
from frictionid.check.motion import Motion
from frictionid.check.torque_integral import Impulse
from frictionid.data.recordings import Dataset
from frictionid.data.signals import Signal
from frictionid.mechanics import Plant, mechanism_of

# Shortest stretch [s] and readings; windows over which balances are taken [s].
LONG, READINGS, WIDTH = 0.2, 5, 0.07
# The remainder in a stretch is this many times that elsewhere, and this share of the torque's root
# mean square over all recordings; elsewhere it is at most that share. (Simulated: healthy stretches
# up to 3.0 times, frozen ones from 4.0 times, elsewhere up to 0.3; wrong angles from 2.)
WORSE, LARGE, FITS = 3.5, 0.4, 0.5


class Stretch(NamedTuple):
    """A torque that repeats: recording, joint (from 0), start and stop [s], the reading [N m]."""

    recording: int
    joint: int
    start: float
    stop: float
    value: float


def stuck(
    dataset: Dataset, plant: Plant, motions: Sequence[Motion], impulse: Impulse
) -> tuple[list[Finding], set[int]]:
    """Findings of torques that stand still and should not, and the recordings they are in."""
    stretches = [
        stretch
        for i, recording in enumerate(dataset.recordings)
        for stretch in _stretches(i, recording.torque)
        if plant.mechanism.description.driven[stretch.joint]
    ]
    if not stretches:
        return [], set()
    rows = unit_rows(plant.mechanism, motions, width=WIDTH)
    torque = impulse.means(rows)
    left = torque - (rows.phi * np.asarray(plant.p)[rows.recording][:, None]).sum(-1)
    hits = [s for s in stretches if _contradicts(s, rows, torque, left)]
    return _findings(dataset, hits), {s.recording for s in hits}


def _stretches(number: int, torque: Signal) -> list[Stretch]:
    """Stretches of equal readings, each to its last reading."""
    time, out = np.asarray(torque.time), []
    for j, column in enumerate(np.asarray(torque.value).T):
        changes = np.flatnonzero(np.diff(column) != 0.0)
        first = np.concatenate([[0], changes + 1])
        last = np.concatenate([changes, [len(column) - 1]])
        for a, b in zip(first, last, strict=True):
            if b - a + 1 >= READINGS and time[b] - time[a] >= LONG:
                out.append(Stretch(number, j, float(time[a]), float(time[b]), float(column[a])))
    return out


def _contradicts(stretch: Stretch, rows: Rows, torque: Array, left: Array) -> bool:
    """Whether the motion contradicts the torque of a stretch."""
    j, own = stretch.joint, rows.recording == stretch.recording
    free = rows.free[:, j]
    inside = free & own & (rows.start >= stretch.start) & (rows.stop <= stretch.stop)
    apart = free & ~(own & (rows.stop > stretch.start) & (rows.start < stretch.stop))
    if not inside.any():
        return False
    level = np.sqrt(np.mean(torque[:, j] ** 2))
    if apart.sum() < FEWEST:  # it never changes: all that can be asked is whether it fits at all
        rest = _remainder(rows.friction[:, j], left[:, j], inside)
        return bool(stretch.value != 0.0 and _rms(rest[inside]) > LARGE * level)
    rest = _remainder(rows.friction[:, j], left[:, j], apart)
    elsewhere = _rms(rest[apart])
    worse = _rms(rest[inside]) > max(WORSE * elsewhere, LARGE * level)
    return bool(worse and elsewhere < FITS * level)


def _remainder(shapes: Array, target: Array, use: Array) -> Array:
    """What friction fitted to some of the windows leaves in all of them [N m]."""
    size = np.sqrt((shapes[use] ** 2).sum(0))
    size = np.where(size > 0, size, 1.0)
    fitted = np.linalg.lstsq(shapes[use] / size, target[use], rcond=1e-9)[0] / size
    rest: Array = target - shapes @ fitted
    return rest


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _findings(dataset: Dataset, hits: list[Stretch]) -> list[Finding]:
    unit = mechanism_of(dataset.mechanism).description.torque_unit
    found = []
    for joint in sorted({s.joint for s in hits}):
        own = [s for s in hits if s.joint == joint]
        worst = max(own, key=lambda s: s.stop - s.start)
        length = worst.stop - worst.start
        more = f", and {len(own) - 1} times more" if len(own) > 1 else ""
        found.append(
            Finding(
                "frozen_torque",
                "doubtful",
                f"torque {joint + 1} stands still at {worst.value:.3g} {unit} for {length:.2g} s "
                f"while the motion asks for others, in {dataset.recordings[worst.recording].name!r}"
                f" at {worst.start:.3g} s{more}",
                "cut these stretches out, or record them again",
                joint + 1,
                {"longest": length, "stretches": float(len(own)), "value": worst.value},
            )
        )
    return found
