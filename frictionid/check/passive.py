"""What physics forbids: energy that rises without input, and loads that friction could not hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.check.balance_windows import Rows
from frictionid.check.findings import Finding
from frictionid.check.motion import Motion
from frictionid.check.regression import Estimate
from frictionid.check.torque_integral import Impulse
from frictionid.data.recordings import Recording
from frictionid.data.signals import sample
from frictionid.mechanics import Mechanism

# Shortest passive phase [s]; energy may seem to rise by this share of its range in it.
PHASE, RISE = 0.5, 0.25
# At rest the load stays below this many times the sliding level: break-away peaks are smaller.
BAND = 2.5


def passive_phases(recording: Recording, motion: Motion) -> list[slice]:
    """Stretches of samples of the motion in which no torque acts."""
    level = 1e-3 * float(np.abs(recording.torque.value).max())
    u = np.abs(sample(recording.torque, motion.states.time)).max(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (u <= level).astype(int), [0]])))
    time = motion.states.time
    return [
        slice(int(a), int(b))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if time[b - 1] - time[a] >= PHASE
    ]


def passive_time(recordings: Sequence[Recording], motions: Sequence[Motion], rest: Array) -> float:
    """Time [s] without torque in which something moves."""
    total = 0.0
    for recording, motion in zip(recordings, motions, strict=True):
        for phase in passive_phases(recording, motion):
            moving = (np.abs(motion.states.w[phase]) > rest).any(1)
            total += float((np.gradient(motion.states.time[phase]) * moving).sum())
    return total


def energy_rises(
    mechanism: Mechanism, recordings: Sequence[Recording], motions: Sequence[Motion], told: Array
) -> list[tuple[float, str, float]]:
    """Largest rise of energy in each passive phase, over its range; recording and start [s]."""
    return [
        (
            energy_rise(mechanism, told[i], motion, phase),
            recording.name,
            float(motion.states.time[phase.start]),
        )
        for i, (recording, motion) in enumerate(zip(recordings, motions, strict=True))
        for phase in passive_phases(recording, motion)
    ]


def energy(
    mechanism: Mechanism, recordings: Sequence[Recording], motions: Sequence[Motion], told: Array
) -> list[Finding]:
    """A finding where the told mechanism's energy rises in passive phases: something is wrong."""
    rises = energy_rises(mechanism, recordings, motions, told)
    worst, where, at = max(rises, default=(0.0, "", 0.0))
    if worst <= RISE:
        return []
    return [
        Finding(
            "energy",
            "doubtful",
            f"without torque the energy of the told mechanism rises by {100 * worst:.0f} % of its "
            f"range, in {where!r} from {at:.3g} s",
            "check masses, lengths and frames: energy must fall",
            None,
            {"rise": worst},
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


def rest_loads(rows: Rows, impulse: Impulse, told: Array, rest: Array) -> list[Array]:
    """|torque - gravity| of each joint over the windows in which all joints rest [N m]."""
    still = (np.abs(rows.w) < rest).all(1) & ~rows.free.any(1)
    # a joint that swings through a reversal is slow on average, too: look at the acceleration
    terms = [(x * told[rows.recording][:, None]).sum(-1) for x in (rows.inertia, rows.gravity)]
    load = np.abs(impulse.means(rows) - terms[1])
    level = np.abs(terms[1]).max(0)
    still &= (np.abs(terms[0]) < 0.02 * level + 1e-12).all(1)
    return [load[still, j] for j in range(load.shape[1])]


def gravity_at_rest(
    rows: Rows, impulse: Impulse, told: Array, rest: Array, estimate: Estimate
) -> list[Finding]:
    """Findings of joints that rest under loads which their friction could not hold."""
    found = []
    gravity = np.abs((rows.gravity * told[rows.recording][:, None]).sum(-1)).max(0)
    for j, load in enumerate(rest_loads(rows, impulse, told, rest)):
        level, error = estimate.at(f"coulomb_{j + 1}")
        if len(load) < 10 or not np.isfinite(error) or level < 4 * error:
            continue
        band = BAND * (level + 2 * error) + 0.02 * float(gravity[j])
        high = float(np.quantile(load, 0.9))
        if high > band:
            found.append(
                Finding(
                    "gravity_at_rest",
                    "doubtful",
                    f"joint {j + 1} rests under {high:.3g} N m, yet its friction slides at "
                    f"{level:.3g} N m: torque and gravity do not balance",
                    "check the zero of the angles, the offset of the torque and the masses",
                    j + 1,
                    {"load": high, "band": band},
                )
            )
    return found
