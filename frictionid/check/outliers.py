"""Gross outliers of angles and torques, by recording and count, and the data without them.

Fits leave them out, and so do the other checks: the smoother shows which angles, the momentum
balance which torques.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.arrays import Array
from frictionid.check.findings import Finding
from frictionid.check.motion import Measured
from frictionid.fitting.one_step.torque_outliers import torque_outliers, with_torques_replaced

# Shares of a recording's samples: fewer are rough motion as likely as a glitch, more are doubtful.
_SOME, _MANY = 2e-3, 0.01
_NAMED = 4  # recordings at most


def without_outliers(measured: Measured) -> tuple[Measured, list[Finding]]:
    """The data without outliers of the torque, and a finding for each joint that has outliers.

    Of recordings in which no torque is frozen, before anything is corrected. The motions are
    without outliers of the angle already.
    """
    dataset, states = measured.dataset, [motion.states for motion in measured.motions]
    angles = [np.zeros(s.q.shape, bool) if s.left_out is None else s.left_out for s in states]
    torques = torque_outliers(dataset, measured.plant, states)
    names = [recording.name for recording in dataset.recordings]
    found = [*_findings("angle", angles, names), *_findings("torque", torques, names)]
    return measured.with_torques_of(with_torques_replaced(dataset, torques)), found


def _findings(quantity: str, masks: Sequence[Array], names: Sequence[str]) -> list[Finding]:
    out = []
    size = np.array([len(mask) for mask in masks])
    for j in range(masks[0].shape[1]):
        count = np.array([mask[:, j].sum() for mask in masks])
        count = np.where(count >= _SOME * size, count, 0)
        if not count.any():
            continue
        share = float(count.sum() / size[count > 0].sum())
        out.append(
            Finding(
                f"{quantity}_outliers",
                "doubtful" if share > _MANY else "good",
                f"{quantity} {j + 1} has {count.sum()} gross outliers, which fits leave out: "
                + _by_recording(count, names),
                "look for lost packets, wrong bits or a marker taken for another",
                j + 1,
                {"outliers": float(count.sum()), "share": share},
            )
        )
    return out


def _by_recording(count: Array, names: Sequence[str]) -> str:
    """Recordings with their counts, those with most first."""
    order = [int(i) for i in np.argsort(-count, kind="stable") if count[i]]
    text = ", ".join(f"{count[i]} in {names[i]!r}" for i in order[:_NAMED])
    more = order[_NAMED:]
    rest = f", and {int(count[more].sum())} in {len(more)} other recordings" if more else ""
    return text + rest
