"""Samples that are too far apart for the motion between them.

Between two samples friction is a mean over the speeds that the joint ran through, and the smoother
cannot tell how it got from one to the other. Simulated acrobots: one-step fits are three times as
wrong where a joint's velocity changes by 12 % of its fast speed from sample to sample (20 Hz), and
twenty times where it changes by 21 % (10 Hz); shooting is less harmed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding, percent
from frictionid.check.motion import Measured, Motion

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
