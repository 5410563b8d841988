"""Data that shooting cannot use, refused before the fit; and doubts about what it found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.mechanics import mechanism_of, parameters_of
from frictionid.shooting.gauss_newton import Shot
from frictionid.shooting.intervals import Track, cut
from frictionid.shooting.linearise import Intervals, Part

_TURN = 2 * np.pi
_FEW = 4  # windows: of fewer, no interval is worth the name
_STILL = 10.0  # [noise]: a joint that moves less does not move
_MAD = 1.4826  # standard deviation over median absolute deviation, of normal noise
_MORE = 8.0  # times what the smoother takes off, which is some 0.6 of the noise
_SCALE = 10.0  # times the told base parameters


def complain(track: Track, parts: Sequence[Part], seconds: float) -> None:
    """Refuse data with too few windows of so many seconds, wrapped angles, or joints at rest.

    Raises
    ------
    InputError
        Saying which.
    """
    table = track.dataset.mechanism
    if mechanism_of(table).description.angle_unit == "rad":
        _complain_of_turns(track)
    _complain_of_length(track, parts, seconds)
    still = _still(track)
    for part in parts:
        for entry in part.entries:
            if entry.block == "friction" and entry.place and still[entry.place[0]]:
                raise InputError(
                    f"data set {track.dataset.name!r}: joint {entry.place[0] + 1} of the "
                    f"{table['kind']} never moves by more than the noise of its angle, so "
                    f"{entry.name!r} does not show: give recordings in which it moves, or a "
                    "mechanism without it"
                )


def _complain_of_turns(track: Track) -> None:
    values = [r.angle.value for r in track.dataset.recordings]
    span = np.ptp(np.concatenate(values), axis=0)
    for recording, value in zip(track.dataset.recordings, values, strict=True):
        jumps = (np.abs(np.diff(value, axis=0)) > _TURN / 2) & (span <= _TURN + 0.1)
        if jumps.any():
            k, j = np.argwhere(jumps)[0]
            raise InputError(
                f"recording {recording.name!r}: angle {j + 1} jumps by "
                f"{value[k + 1, j] - value[k, j]:+.2f} rad at {recording.angle.time[k]:.2f} s and "
                "never leaves one turn: it is wrapped at half a turn; unwrap it (numpy.unwrap)"
            )


def _complain_of_length(track: Track, parts: Sequence[Part], seconds: float) -> None:
    windows = cut(track, np.ones(len(track.dt), dtype=bool), seconds)
    lengths = (windows >= 0).sum(axis=1) + 1
    # what a window's own start state takes up tells nothing of the shared parameters
    told = int(((lengths - 2) * track.n).sum())
    count = parts[-1].columns.stop if parts else 0
    if len(windows) < _FEW or told < 2 * count:
        raise InputError(
            f"data set {track.dataset.name!r}: {int(lengths.sum())} samples make "
            f"{len(windows)} windows of {seconds:.2g} s, too few for {count} free parameters and "
            "their intervals: give longer recordings, or free less"
        )


def _still(track: Track) -> Array:
    """Joints (n,) that never move in any recording."""
    reach = [np.ptp(s.q, axis=0) for s in track.states]
    return np.asarray(np.max(reach, axis=0) <= _STILL * _noise(track))


def _noise(track: Track) -> Array:
    """Noise (n,) [rad] of the angles: what the smoother took off."""
    return np.asarray(_MAD * np.median(np.abs(track.before - track.q), axis=0))


def doubts(intervals: Intervals, shot: Shot) -> Iterator[str]:
    """Sentences on what makes the numbers of a fit doubtful as a whole, none where nothing does."""
    found = [*_coarse(intervals, shot), *_far(intervals, shot), *_scaled(intervals, shot)]
    yield from found
    if found:
        yield (
            "`frictionid check` looks for wrong signs, late clocks, wrapped angles and other "
            "mistakes in the data."
        )


def _coarse(intervals: Intervals, shot: Shot) -> Iterator[str]:
    off = shot.sigma / np.maximum(_noise(intervals.track), 1e-12)
    worst = int(np.argmax(off))
    if off[worst] > _MORE:
        yield (
            f"Angle {worst + 1} is predicted {off[worst]:.0f} times worse than it is measured: "
            "what is fitted does not explain the motion."
        )


def _far(intervals: Intervals, shot: Shot) -> Iterator[str]:
    for part in intervals.parts:
        for entry in part.block.entries(shot.guess):
            if entry.block == "delay" and not entry.low < entry.value < entry.high:
                yield (
                    f"The torque delay ends at {entry.value:+.2g} s, as far as it may go: the "
                    "clocks may be further apart, or the logs do not belong together."
                )


def _scaled(intervals: Intervals, shot: Shot) -> Iterator[str]:
    base: Array = np.asarray(shot.guess.calibration.base)
    mechanism, table = shot.guess.mechanism, intervals.track.dataset.mechanism
    told = np.asarray(mechanism.base(parameters_of(table, {})))
    size = float(np.median(np.abs(base) / np.maximum(np.abs(told), 1e-12)))
    if not 1 / _SCALE < size < _SCALE:
        yield (
            f"The base parameters are {size:.2g} times what is told: the motion does not show the "
            "logged torque."
        )
