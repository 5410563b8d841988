"""Recordings of a training fold that are held out in it: what says when to stop, and how to choose.

A fold's rows alone decide, together with the seed: so it is the same alone and among others.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.identifiers.residual import Problem

_FEW = 4  # recordings of a fold: fewer are divided into pieces
_PIECES = 8


def check_share(share: float) -> None:
    """Refuse shares that leave nothing to fit, or nothing to judge by.

    Raises
    ------
    InputError
        Saying what a share may be.
    """
    if not 0 < share <= 0.5:
        raise InputError(f"share = {share!r} of the rows held out must be in (0, 0.5]")


def held_out(problem: Problem, weights: Array, share: float, seed: Any) -> Array:
    """Rows (F, K) that are held out within each fold: about that share of its weight, or more.

    Whole recordings in an order of the seed, a number or some; of fewer than four of them, pieces.
    """
    rng = np.random.default_rng(seed)
    whole = problem.recording
    pieces = _pieces(problem)
    order = rng.permutation(int(whole.max()) + 1), rng.permutation(int(pieces.max()) + 1)
    out = np.zeros(weights.shape, dtype=bool)
    for f, weight in enumerate(weights):
        few = len(np.unique(whole[weight > 0])) < _FEW
        label, turns = (pieces, order[1]) if few else (whole, order[0])
        sizes = np.bincount(label, weight, len(turns))[turns]
        behind = np.cumsum(sizes) - sizes < share * weight.sum()
        chosen = turns[behind & (sizes > 0)]
        out[f] = np.isin(label, chosen) & (weight > 0)
    return out


def _pieces(problem: Problem) -> Array:
    """Piece (K,) of each row: each recording is cut into eight."""
    _, first, counts = np.unique(problem.recording, return_index=True, return_counts=True)
    inner = np.arange(len(problem.recording)) - np.repeat(first, counts)
    return problem.recording * _PIECES + inner * _PIECES // np.repeat(counts, counts)
