"""Torque that equals a gravity model: a function of the angles, in which no friction shows."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.motion import Measured
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import sample
from frictionid.mechanics import Mechanism

# Residual of most samples over the torque's own size: friction and inertia leave more in any
# measurement. A few samples may differ (the controller's start and end, glitches).
EQUAL, MOST = 0.02, 0.8
_SAMPLES = 500  # of a recording that are used


def gravity_models(measured: Measured) -> list[Finding]:
    """Findings of joints whose torque is a function of the angles, b + sum of gravity terms."""
    out = []
    mechanism = measured.mechanism
    for j in np.flatnonzero(mechanism.driven).tolist():
        acts = [i for i, r in enumerate(measured.dataset.recordings) if r.torque.value[:, j].any()]
        shares = {i: gravity_share(measured.dataset.recordings[i], mechanism, j) for i in acts}
        commands = {i: share for i, share in shares.items() if share is not None}
        if commands:
            out.append(_finding(measured.dataset, j, commands, len(commands) == len(acts)))
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


def gravity_share(recording: Recording, mechanism: Mechanism, j: int) -> float | None:
    """Share of torque j that b + sum of gravity terms leaves, None where it is no such function.

    Shares are of most samples, so that a few glitches make neither the torque nor the model.
    """
    keep = slice(None, None, max(len(recording.torque.time) // _SAMPLES, 1))
    time, torque = recording.torque.time[keep], recording.torque.value[keep, j]
    if len(time) < 30:
        return None
    size, varies = _most(np.abs(torque)), _most(np.abs(torque - np.median(torque)))
    if size < 1e-9 or varies < 0.05 * size:
        return None
    dt = float(np.median(np.diff(recording.torque.time)))
    # a controller computes from the sample before or from this one
    left = min(_residual(recording, mechanism, j, time - late, torque) for late in (0.0, dt))
    share = left / size
    return share if share < EQUAL else None


def _residual(
    recording: Recording, mechanism: Mechanism, j: int, time: Array, torque: Array
) -> float:
    """Residual [N m] of most samples after a robust fit of gravity at the angles of some times."""
    q = sample(recording.angle, time)
    unit = np.eye(len(mechanism.base_names))[:, None, :]
    gravity = -mechanism.terms(unit, q, np.zeros_like(q)).dLdq[..., j].T
    columns = np.column_stack([gravity[:, np.abs(gravity).max(0) > 0], np.ones(len(q))])
    use = np.ones(len(q), dtype=bool)
    for _ in range(4):  # trimmed least squares: the samples that fit best decide
        x = np.linalg.lstsq(columns[use], torque[use], rcond=1e-10)[0]
        left = np.abs(torque - columns @ x)
        use = left <= _most(left)
    return _most(left)


def _most(sizes: Array) -> float:
    """Size that most samples do not exceed."""
    place = int(MOST * (len(sizes) - 1))
    return float(np.partition(sizes, place)[place])
