"""Torques that are not measured, against the motion.

Where the drive follows and the machine is known, the motion bears a command out, and friction may
be fitted to it. What is left otherwise is the drive's error, which a fit takes for friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.hypothesis_tests import Delay
from frictionid.check.regression import Estimate, Regression
from frictionid.check.torque_source import TorqueSource
from frictionid.fitting.one_step.balances import Rows

# Least squares may leave this share of a joint's torque, or this many times the noise of the motion
# (simulated drives that follow: up to 0.09 and 4.6; a real arm under its commands: 0.13 to 0.27).
LEFT, NOISE = 0.1, 3.0


def unmeasured(
    sources: Sequence[TorqueSource],
    regression: Regression,
    estimate: Estimate,
    delay: Delay | None,
) -> list[Finding]:
    """Findings of commanded and modelled torques that the motion does not bear out."""
    share, times = _left(regression, estimate)
    out = []
    for source in sources:
        j = source.joint - 1
        if source.source not in ("commanded", "modelled") or share[j] < LEFT or times[j] < NOISE:
            continue
        out.append(
            Finding(
                f"{source.source}_torque",
                "doubtful",
                f"{source.sentence}; the motion leaves {100 * share[j]:.0f} % of it unexplained"
                f"{_lag(delay)}",
                "record the torque that the drive reports (its current); friction fitted to this "
                "one includes what the drive or its model gets wrong",
                source.joint,
                {"left": float(share[j]), "noise": float(times[j])},
            )
        )
    return out


def _lag(delay: Delay | None) -> str:
    low, high = delay.interval if delay else (0.0, 0.0)
    return f" and follows it by {1e3 * low:.0f} to {1e3 * high:.0f} ms" if low > 0 else ""


def _left(regression: Regression, estimate: Estimate) -> tuple[Array, Array]:
    """Residual (n,) of the least squares: as a share of the torque, and over the motion's noise."""
    measured, rows, torque = regression.measured, regression.rows, regression.torque
    nominal = measured.nominal
    found = estimate.value[: nominal.shape[1]]
    needed = rows.required(nominal - nominal[0] + found)
    size = np.maximum(*(_rms(np.where(rows.moving, x, 0.0), rows) for x in (torque, needed)))
    rest = np.zeros((1, measured.mechanism.n))
    inertia = np.abs(np.diagonal(measured.mechanism.dynamics(nominal[0], rest, rest)[0][0]))
    velocity = np.median([m.velocity_noise for m in measured.motions], axis=0)
    noise = inertia * velocity * np.sqrt(2.0) / float(np.median(rows.stop - rows.start))
    tiny = np.finfo(float).tiny
    return estimate.spread / np.maximum(size, tiny), estimate.spread / np.maximum(noise, tiny)


def _rms(values: Array, rows: Rows) -> Array:
    return np.asarray(np.sqrt((values**2).sum(0) / np.maximum(rows.moving.sum(0), 1)))
