"""Tests of the unit of time, by the motion that the nominal mechanism would make."""

from dataclasses import replace

import numpy as np

from frictionid.data.recordings import Dataset, Recording, TrueMotion
from frictionid.data.signals import Signal

from .conventions import MARGIN, log_unexplained
from .findings import Finding, finding
from .motion import Measured, motions_of, windows_of

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
    recordings = tuple(_clocked(factor, recording) for recording in dataset.recordings)
    corrected = replace(dataset, recordings=recordings)
    measured = Measured.of_dataset(corrected, motions_of(corrected.recordings))
    rows = windows_of(measured.balances).at(measured.nominal)
    torque = rows.means(measured.torque)
    # with the times of the table, then with the corrected ones
    before, score = (
        float(log_unexplained(rows._replace(inertia=f**2 * rows.inertia), torque).mean())
        for f in (factor, 1.0)
    )
    if not score < before - MARGIN:
        return dataset, []
    numbers = {"factor": factor, "interval": interval, "score": score, "given": before}
    words = {"unit": UNITS[factor], "actual": factor * interval}
    return corrected, [finding("time_unit", numbers, words)]


def _clocked(factor: float, recording: Recording) -> Recording:
    """The recording with its times multiplied."""

    def clocked(signal: Signal) -> Signal:
        return signal._replace(time=factor * signal.time)

    truth, velocity = recording.truth, recording.velocity
    return replace(
        recording,
        angle=clocked(recording.angle),
        torque=clocked(recording.torque),
        velocity=velocity and clocked(velocity),
        covariates={key: clocked(signal) for key, signal in recording.covariates.items()},
        truth=truth and TrueMotion(clocked(truth.angle), clocked(truth.velocity)),
    )
