"""Weights of rows: normalised ones, and smaller ones for rows that no friction explains."""

from __future__ import annotations

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.fitting.one_step.residual import Problem

_NORMAL = 1.4826  # standard deviation over median absolute size of normal errors


def normalised(weights: Array, problem: Problem) -> Array:
    """Weights (F, K) that add up to one in each fold.

    Raises
    ------
    InputError
        For another shape, weights that are negative or not finite, and folds without rows.
    """
    weights, K = np.asarray(weights, dtype=float), len(problem.r)
    if weights.ndim != 2 or weights.shape[1] != K:
        raise InputError(f"weights must have shape (folds, {K}), got {weights.shape}")
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise InputError("weights must be finite and not negative")
    highest = weights.max(axis=1, initial=0.0, keepdims=True)
    if not highest.all():
        fold = int(np.argmin(highest))
        raise InputError(f"fold {fold} has no rows to fit: use fewer folds or more recordings")
    weights = weights / highest
    return weights / weights.sum(axis=1, keepdims=True)


def huber_factors(residual: Array, weights: Array, clip: float) -> Array:
    """Factors (F, K) of the rows' weights by Huber's rule [Huber1964].

    One for rows whose residual (F, K, n) is within `clip` standard deviations in all joints, and
    clip over its size in them for others. A joint's standard deviation is that of the fold's rows
    without their tails, from the weighted median; rows in which its residual is zero (stiction, see
    `mask_stiction`) do not count in it.

    >>> residual = np.array([[[1.0], [-1.0], [2.0], [-2.0], [100.0]]])
    >>> huber_factors(residual, np.ones((1, 5)), clip=3.0)[0].round(3)
    array([1.   , 1.   , 1.   , 1.   , 0.089])
    """
    return np.stack([_factors(*pair, clip) for pair in zip(residual, weights, strict=True)])


def _factors(residual: Array, weights: Array, clip: float) -> Array:
    """Factors (K,) of one fold's residual (K, n) and weights (K,)."""
    size = np.abs(residual)
    order = np.argsort(size, axis=0)
    ordered = np.take_along_axis(size, order, axis=0)
    counted = np.where(ordered > 0, weights[order], 0.0)
    cumulated = np.cumsum(counted, axis=0)
    middle = (cumulated >= 0.5 * cumulated[-1:]).argmax(axis=0)[None]
    median = np.take_along_axis(ordered, middle, axis=0)
    allowed = np.maximum(clip * _NORMAL * median, 1e-300)
    return np.asarray(np.min(allowed / np.maximum(size, allowed), axis=-1))
