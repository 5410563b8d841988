"""Torque that equals a gravity model: a function of the angles, in which no friction shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.motion import Measured
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import sample

# Residual of most samples over the torque's own size: friction and inertia leave more in any
# measurement. A few samples may differ (the controller's start and end, glitches).
EQUAL, MOST = 0.02, 0.8
_SAMPLES = 500  # of a recording that are used
_FEWEST = 30  # of a recording that a statement needs
_TOGETHER = 50_000  # samples whose gravity is evaluated in one go

# Share of a torque that b + sum of gravity terms leaves, by recording and joint (from 0), of those
# torques that are such a function.
GravityShares = Mapping[tuple[str, int], float]


def gravity_findings(measured: Measured, shares: GravityShares) -> list[Finding]:
    """Findings of joints whose torque is a function of the angles, b + sum of gravity terms."""
    out = []
    for j in np.flatnonzero(measured.mechanism.driven).tolist():
        acts = [r.name for r in measured.dataset.recordings if r.torque.value[:, j].any()]
        commands = {name: shares[name, j] for name in acts if (name, j) in shares}
        if commands:
            out.append(_finding(j, commands, len(commands) == len(acts)))
    return out


def _finding(j: int, shares: Mapping[str, float], everywhere: bool) -> Finding:
    names = ", ".join(repr(name) for name in list(shares)[:3])
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


class _Log(NamedTuple):
    """Some samples (S,) of a recording's torques, with the angles that a controller knew then.

    torque (S, n) ; q (2, S, n) : angles at these samples, and at the samples before
    """

    name: str
    torque: Array
    q: Array


def gravity_shares(dataset: Dataset) -> GravityShares:
    """Torques that equal a gravity model, and the share of each that it leaves.

    Shares are of most samples, so that a few glitches make neither the torque nor the model.
    """
    logs = [_log(r) for r in dataset.recordings if len(r.torque.time) >= _FEWEST]
    out: dict[tuple[str, int], float] = {}
    some, count = [], 0
    for i, log in enumerate(logs):
        some.append(log)
        count += log.q[..., 0].size
        if count >= _TOGETHER or i == len(logs) - 1:
            out |= _shares(dataset, some)
            some, count = [], 0
    return out


def _log(recording: Recording) -> _Log:
    torque = recording.torque
    keep = slice(None, None, max(len(torque.time) // _SAMPLES, 1))
    time, dt = torque.time[keep], float(np.median(np.diff(torque.time)))
    q = np.stack([sample(recording.angle, time - late) for late in (0.0, dt)])
    return _Log(recording.name, torque.value[keep], q)


def _shares(dataset: Dataset, logs: list[_Log]) -> dict[tuple[str, int], float]:
    mechanism, n = dataset.mechanism, dataset.mechanism.n
    q = np.concatenate([log.q.reshape(-1, n) for log in logs])
    unit = np.eye(len(mechanism.base_names))[:, None, :]
    gravity = -mechanism.terms(unit, q, np.zeros_like(q)).dLdq
    ends = np.cumsum([log.q[..., 0].size for log in logs])[:-1]
    out = {}
    for log, own in zip(logs, np.split(gravity, ends, axis=1), strict=True):
        for j in np.flatnonzero(mechanism.driven).tolist():
            # a controller computes from the sample before or from this one
            share = _share(log.torque[:, j], np.split(own[..., j].T, 2))
            if share is not None:
                out[log.name, j] = share
    return out


def _share(torque: Array, gravity: list[Array]) -> float | None:
    """Share of a torque (S,) that the best of some gravity terms (S, nb) leaves, None if much."""
    if len(torque) < _FEWEST:
        return None
    size, varies = _most(np.abs(torque)), _most(np.abs(torque - np.median(torque)))
    if size < 1e-9 or varies < 0.05 * size:
        return None
    share = min(_residual(terms, torque) for terms in gravity) / size
    return share if share < EQUAL else None


def _residual(gravity: Array, torque: Array) -> float:
    """Residual [N m] of most samples after a robust fit of gravity terms (S, nb)."""
    columns = np.column_stack([gravity[:, np.abs(gravity).max(0) > 0], np.ones(len(torque))])
    use = np.ones(len(torque), dtype=bool)
    for _ in range(4):  # trimmed least squares: the samples that fit best decide
        x = np.linalg.lstsq(columns[use], torque[use], rcond=1e-10)[0]
        left = np.abs(torque - columns @ x)
        use = left <= _most(left)
    return _most(left)


def _most(sizes: Array) -> float:
    """Size that most samples do not exceed."""
    place = int(MOST * (len(sizes) - 1))
    return float(np.partition(sizes, place)[place])
