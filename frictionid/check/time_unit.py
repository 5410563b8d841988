"""Unit of time: milliseconds, microseconds or seconds that were read as another of these.

A time that is f times too long makes accelerations f^2 times too small and leaves gravity, friction
and the torque as they are, so that one set of balances shows which unit the mechanism moves in.
Machines are sampled 5 to 5000 times a second: that leaves one unit to compare with the given one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from frictionid.check.balance_windows import windows_of
from frictionid.check.conventions import MARGIN, log_unexplained
from frictionid.check.findings import Finding, percent
from frictionid.check.motion import Measured, motions_of
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
