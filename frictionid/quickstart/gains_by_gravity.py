"""What a current is in N m, by the masses of a robot's file, where their load shows in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.evaluation import Protocol, prepare
from frictionid.evaluation.torque_left import row_torques
from frictionid.fitting.one_step.residual import stiction_mask

_WINDOW, _CLUSTER = 0.05, 20  # [s], and windows
_SURE = 0.1  # standard error of a gain, as a share of it
_EXPLAINS = 0.8  # share of a joint's load, at least
_FEWEST = 80  # windows of sliding


class Gain(NamedTuple):
    """Joint torque by unit of its column, and the standard error."""

    value: float
    error: float


def gains_by_gravity(dataset: Dataset) -> list[Gain | None]:
    """Gain of each joint's torque column, None where the file's masses do not show in it.

    Least squares, over windows in which the joint slides, of

        what the rigid bodies need = gain column - coulomb sgn(w) - viscous w + offset
    """
    problem, n = prepare(dataset, Protocol()).integral, dataset.mechanism.n
    left, column = row_torques(problem, problem.r[:, :n], np.ones(len(problem.r), dtype=bool))
    w = problem.nodes.inputs.w[problem.stencil[:, 1], :n]
    rests = stiction_mask(problem, None)[:, :n]
    number = np.floor(problem.time / _WINDOW + 1e-9)
    keys = np.stack([problem.recording, number], axis=1)
    _, place = np.unique(keys, axis=0, return_inverse=True)
    place = place.reshape(-1)
    rows = np.bincount(place)
    out: list[Gain | None] = []
    for j in range(n):
        parts = (column[:, j], -np.sign(w[:, j]), -w[:, j], column[:, j] - left[:, j])
        *means, need = (np.bincount(place, part) / rows for part in parts)
        slides = np.bincount(place, rests[:, j]) == 0
        A = np.column_stack([*means, np.ones(len(rows))])[slides]
        out.append(_gain(A, need[slides]))
    return out


def _gain(A: Array, need: Array) -> Gain | None:
    """Gain of the first column (W, 4) for what is needed (W,), errors clustered over time."""
    if len(A) < _FEWEST:
        return None
    x, _, rank, _ = np.linalg.lstsq(A, need)
    left = need - A @ x
    if rank < A.shape[1] or left.var() > (1 - _EXPLAINS) * need.var():
        return None
    scores = np.add.reduceat(A * left[:, None], np.arange(0, len(A), _CLUSTER))
    inverse = np.linalg.inv(A.T @ A)
    error = float(np.sqrt((inverse @ scores.T @ scores @ inverse)[0, 0]))
    return Gain(float(x[0]), error) if error < _SURE * abs(x[0]) else None
