"""Friction as an equation, with an interval behind each coefficient."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes half a second to import

from frictionid.arrays import Array
from frictionid.friction import Friction
from frictionid.identifiers.ols_covariance import half_widths
from frictionid.identifiers.residual import Problem
from frictionid.shooting import Refined


def equations(
    friction: Friction, problem: Problem, weights: Array, refined: Refined | None = None
) -> dict[str, list[str]]:
    """What provenance says of a law that has an `equation`: one line for each joint; else nothing.

    Intervals of 95 % are those of shooting where that found the friction (n, P), and else those of
    its one-step fit to the problem under weights (K,).
    """
    if not friction.law.is_sparse:
        return {}
    half = half_widths(friction, problem, weights) if refined is None else _shot(refined)
    return {"equation": friction.law.equation(friction.theta, half, friction.angle_unit)}


def _shot(refined: Refined) -> Array:
    covariance = refined.covariance
    half = np.full(np.shape(refined.friction.theta), np.nan)
    for entry, error in zip(covariance.parameters, covariance.error, strict=True):
        if entry.block == "friction":
            half[entry.place] = stdtrit(covariance.freedom, 0.975) * error
    return half
