"""Horizons and sample time that follow the data, where nobody has said which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from frictionid.data.recordings import Dataset
from frictionid.evaluation.folds import Folds
from frictionid.evaluation.prepared import Protocol

_OF_ARMS = (0.05, 0.1, 0.2)  # [s]: without its controller an arm drifts off
_FAST, _APART = 0.95e-3, 0.002  # [s] between samples that are more than scores need, and then
_SWINGING = 2  # joints of what no controller must hold


def is_arm(dataset: Dataset) -> bool:
    """Whether a controller held the machine that is in no recording: many joints, all driven."""
    mechanism = dataset.mechanism
    servo = any(r.servo is not None for r in dataset.recordings)
    return mechanism.n > _SWINGING and all(mechanism.driven) and not servo


def protocol_for(protocol: Protocol, held: Sequence[tuple[Dataset, Folds | None]]) -> Protocol:
    """The protocol with horizons that folds, or recordings, hold, where it has the usual ones.

    Of arms the usual ones are shorter. Samples are 2 ms apart where a log has more than 1 kHz.

    held : data sets with their folds, None where whole recordings are predicted
    """
    if protocol.sample_time is None and all(usual_interval(data) < _FAST for data, _ in held):
        protocol = replace(protocol, sample_time=_APART)
    if protocol.horizons != Protocol().horizons:
        return protocol
    usual = _OF_ARMS if all(is_arm(data) for data, _ in held) else protocol.horizons
    room = min(_longest(data, folds) for data, folds in held) - protocol.history
    kept = tuple(h for h in usual if h + protocol.every <= room)
    return replace(protocol, horizons=kept or usual[:1])


def usual_interval(dataset: Dataset) -> float:
    """Usual time [s] between two samples."""
    return float(np.median(np.concatenate([np.diff(r.angle.time) for r in dataset.recordings])))


def _longest(dataset: Dataset, folds: Folds | None) -> float:
    """Longest stretch of time [s] that one fold holds out, or of a recording."""
    if folds is None or not folds.contiguous:
        return max(float(np.ptp(r.angle.time)) for r in dataset.recordings)
    longest = 0.0
    for time, label in zip(folds.times, folds.labels, strict=True):
        edges = np.flatnonzero(np.diff(label)) + 1
        first, last = np.append(0, edges), np.append(edges, len(label)) - 1
        longest = max(longest, float((time[last] - time[first]).max(initial=0.0)))
    return longest
