"""Tests of passivity: energy must fall without input, and friction must hold loads at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.hypothesis_tests import HypothesisTests
from frictionid.check.motion import Measured, Motion
from frictionid.check.regression import Estimate
from frictionid.data.recordings import Recording
from frictionid.data.signals import sample
from frictionid.mechanics import Mechanism

# Shortest passive phase [s]; energy may seem to rise by this share of its range in it.
PHASE, RISE = 0.5, 0.25
# At rest the load stays below this many times the Coulomb level: break-away peaks are smaller.
BAND = 2.5
FEWEST = 10  # windows at rest that a statement needs


def passive_phases(recording: Recording, motion: Motion) -> list[slice]:
    """Samples of the motion without torque, for at least PHASE each."""
    level = 1e-3 * float(np.abs(recording.torque.value).max())
    u = np.abs(sample(recording.torque, motion.states.time)).max(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (u <= level).astype(int), [0]])))
    time = motion.states.time
    return [
        slice(int(a), int(b))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if time[b - 1] - time[a] >= PHASE
    ]


def passive_time(measured: Measured) -> float:
    """Time [s] without torque in which something moves."""
    total = 0.0
    for recording, motion in zip(measured.dataset.recordings, measured.motions, strict=True):
        for phase in passive_phases(recording, motion):
            moving = (np.abs(motion.states.w[phase]) > measured.speeds.threshold).any(1)
            total += float((np.gradient(motion.states.time[phase]) * moving).sum())
    return total


class Rise(NamedTuple):
    """Largest rise of energy in a passive phase, over its range; recording and start [s]."""

    share: float
    recording: str
    start: float


def energy_rises(measured: Measured) -> list[Rise]:
    """Rise of the nominal mechanism's energy in each passive phase."""
    out = []
    for p, recording, motion in zip(
        measured.nominal, measured.dataset.recordings, measured.motions, strict=True
    ):
        for phase in passive_phases(recording, motion):
            share = energy_rise(measured.mechanism, p, motion, phase)
            out.append(Rise(share, recording.name, float(motion.states.time[phase.start])))
    return out


def energy_findings(measured: Measured) -> list[Finding]:
    """A finding where the nominal mechanism's energy rises in passive phases."""
    worst = max(energy_rises(measured), default=Rise(0.0, "", 0.0))
    if worst.share <= RISE:
        return []
    return [
        Finding(
            "energy",
            "doubtful",
            "without torque the energy of the nominal mechanism rises by "
            f"{100 * worst.share:.0f} % of its range, in {worst.recording!r} from "
            f"{worst.start:.3g} s",
            "check masses, lengths and frames: energy must fall",
            None,
            {"rise": worst.share},
        )
    ]


def energy_rise(mechanism: Mechanism, p: Array, motion: Motion, phase: slice) -> float:
    """Largest rise of energy between two moments of a phase, over its range; noise taken off."""
    q, w = motion.states.q[phase], motion.states.w[phase]
    terms = mechanism.terms(p, q, w)
    span = float(np.ptp(terms.energy))
    momentum_noise = np.abs(terms.momentum) @ motion.velocity_noise
    rise = float((terms.energy - np.minimum.accumulate(terms.energy)).max())
    return max(rise - 4.0 * float(np.median(momentum_noise)), 0.0) / max(span, 1e-300)


def rest_loads(tests: HypothesisTests) -> list[Array]:
    """|torque - gravity| of each joint over the windows in which all joints rest [N m]."""
    measured, rows = tests.measured, tests.rows
    nominal = rows.at(measured.nominal)
    inertia, gravity = nominal.inertia[..., 0], nominal.gravity[..., 0]
    still = (np.abs(rows.w) < measured.speeds.threshold).all(1) & ~rows.moving.any(1)
    # a joint that swings through a reversal is slow on average, too: look at the acceleration
    level = np.abs(gravity).max(0)
    still &= (np.abs(inertia) < 0.02 * level + 1e-12).all(1)
    load = np.abs(rows.means(measured.torque) - gravity)
    return [load[still, j] for j in range(load.shape[1])]


def rest_findings(tests: HypothesisTests, estimate: Estimate) -> list[Finding]:
    """Findings of joints that rest under loads which their friction could not hold."""
    out = []
    gravity = np.abs(tests.rows.at(tests.measured.nominal).gravity[..., 0]).max(0)
    for j, load in enumerate(rest_loads(tests)):
        level, error = estimate.at(f"coulomb_{j + 1}")
        if len(load) < FEWEST or not np.isfinite(error) or level < 4 * error:
            continue
        band = BAND * (level + 2 * error) + 0.02 * float(gravity[j])
        high = float(np.quantile(load, 0.9))
        if high > band:
            out.append(
                Finding(
                    "gravity_at_rest",
                    "doubtful",
                    f"joint {j + 1} rests under a load of {high:.3g} N m, but its Coulomb friction "
                    f"is {level:.3g} N m: torque and gravity do not balance",
                    "check the zero of the angles, the offset of the torque and the masses",
                    j + 1,
                    {"load": high, "band": band},
                )
            )
    return out
