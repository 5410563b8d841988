"""Torque that is no measurement: a column that equals a gravity model holds a command.

Such a column is a function of the angle alone; friction does not appear in it, and nothing can be
identified from it.
"""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.motion import Measured
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import sample
from frictionid.mechanics import Mechanism

# Residual of most samples over the torque's root mean square: friction and inertia leave more in
# any measurement. A few samples may differ (the controller's start and end).
EQUAL, MOST = 0.02, 0.8
_SAMPLES = 500  # of a recording that are used


def commanded(measured: Measured) -> list[Finding]:
    """Findings of joints whose torque is a function of the angles, b + sum of gravity terms."""
    out = []
    mechanism = measured.mechanism
    for j in np.flatnonzero(mechanism.description.driven).tolist():
        shares = [_residual_share(r, mechanism, j) for r in measured.dataset.recordings]
        known = {i: share for i, share in enumerate(shares) if share is not None}
        commands = {i: share for i, share in known.items() if share < EQUAL}
        if commands:
            out.append(_finding(measured.dataset, j, commands, len(commands) == len(known)))
    return out


def _finding(dataset: Dataset, j: int, shares: dict[int, float], everywhere: bool) -> Finding:
    names = ", ".join(repr(dataset.recordings[i].name) for i in list(shares)[:3])
    where = "" if everywhere else f" in {names}{' and others' if len(shares) > 3 else ''}"
    worst = max(shares.values())
    return Finding(
        "commanded_torque",
        "unusable" if everywhere else "doubtful",
        f"nothing to identify{where}: the torque equals a gravity model (torque {j + 1} is a "
        f"function of the angle to {100 * worst:.2g} %), so it is a command, not a measurement",
        "record the torque that the drive reports (its current), or leave these recordings out",
        j + 1,
        {"recordings": float(len(shares)), "remainder": worst},
    )


def _residual_share(recording: Recording, mechanism: Mechanism, j: int) -> float | None:
    """Share of the torque that no gravity model explains, None where torque or angle rest."""
    keep = slice(None, None, max(len(recording.torque.time) // _SAMPLES, 1))
    time, torque = recording.torque.time[keep], recording.torque.value[keep, j]
    power = float(np.sqrt((torque**2).mean()))
    if power < 1e-9 or len(time) < 30 or np.std(torque) < 0.05 * power:
        return None
    dt = float(np.median(np.diff(recording.torque.time)))
    # a controller computes from the sample before or from this one
    delays = (0.0, dt)
    return min(_residual(recording, mechanism, j, time - late, torque) for late in delays) / power


def _residual(
    recording: Recording, mechanism: Mechanism, j: int, time: Array, torque: Array
) -> float:
    """Residual [N m] of most samples after a fit of gravity at the angles of some times."""
    q = sample(recording.angle, time)
    unit = np.eye(len(mechanism.base_names))[:, None, :]
    gravity = -mechanism.terms(unit, q, np.zeros_like(q)).dLdq[..., j].T
    columns = np.column_stack([gravity[:, np.abs(gravity).max(0) > 0], np.ones(len(q))])
    left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=1e-10)[0]
    return float(np.quantile(np.abs(left), MOST))
