"""Early stopping: recordings held out inside each training fold say when its cost was lowest.

A fold's rows alone decide, together with the seed: so it is the same alone and among others.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from frictionid.arrays import Array
from frictionid.fitting.one_step.residual import Problem

_FEW = 4  # recordings of a fold: fewer are divided into pieces
_PIECES = 8

Share = Annotated[float, Field(gt=0, le=0.5)]  # of a fold's weight that is held out


class EarlyStopping:
    """Parameters (F, n, P) of each fold at its lowest held-out cost so far.

    A fold stops after `patience` updates without a lower cost, and keeps what it has from then on.
    """

    def __init__(self, theta: Any, patience: int):
        self.theta, self.patience = theta.clone(), patience
        self.cost = theta[:, 0, 0] * 0.0 + math.inf
        self.updates_since = theta[:, 0, 0] * 0.0

    def update(self, theta: Any, cost: Any) -> None:
        """Take the parameters of the folds whose cost (F,) is lower than before."""
        running = self.updates_since < self.patience
        better = running & (cost < self.cost)
        self.theta[better] = theta[better]
        self.cost = cost.where(better, self.cost)
        self.updates_since = (self.updates_since + running) * ~better

    @property
    def stopped(self) -> bool:
        """Whether all folds have stopped."""
        return bool((self.updates_since >= self.patience).all())


def held_out(problem: Problem, weights: Array, share: float, seed: Any) -> Array:
    """Whether each row is held out within each fold, (F, K): a share of its weight, or a bit more.

    Whole recordings, in an order drawn by the seed; where a fold has fewer than four, pieces.
    """
    rng = np.random.default_rng(seed)
    whole = problem.recording
    pieces = _pieces(problem)
    orders = rng.permutation(int(whole.max()) + 1), rng.permutation(int(pieces.max()) + 1)
    out = np.zeros(weights.shape, dtype=bool)
    for f, weight in enumerate(weights):
        few = len(np.unique(whole[weight > 0])) < _FEW
        label, order = (pieces, orders[1]) if few else (whole, orders[0])
        sizes = np.bincount(label, weight, len(order))[order]
        chosen = (np.cumsum(sizes) - sizes < share * weight.sum()) & (sizes > 0)
        out[f] = np.isin(label, order[chosen]) & (weight > 0)
    return out


def _pieces(problem: Problem) -> Array:
    """Piece (K,) of each row: each recording is cut into eight."""
    _, first, counts = np.unique(problem.recording, return_index=True, return_counts=True)
    place = np.arange(len(problem.recording)) - np.repeat(first, counts)
    return problem.recording * _PIECES + place * _PIECES // np.repeat(counts, counts)
