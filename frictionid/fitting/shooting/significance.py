"""Blocks of sensors that show nothing: a test of whether they differ from an ideal sensor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc  # scipy.stats takes half a second to import

from frictionid.fitting.fit import Covariance
from frictionid.fitting.parameters.parameter_block import IDEAL, ParameterBlock
from frictionid.friction.provenance import Dropped


def least_significant(
    covariance: Covariance, blocks: Sequence[ParameterBlock], level: float
) -> Dropped | None:
    """The block of sensors with the largest p-value above a level, or None.

    Its k parameters d, as deviations from an ideal sensor, have the covariance C:

        d' C^-1 d / k   is distributed as F(k, freedom)   where the sensor is ideal

    A block that the data do not determine has p = 1. Blocks with a prior stay: somebody knows them.
    """
    idle = []
    for name in (b.name for b in blocks if b.name in IDEAL):
        places = [k for k, p in enumerate(covariance.parameters) if p.block == name]
        if places and not any(np.isfinite(covariance.parameters[k].tolerance) for k in places):
            idle.append(Dropped(name, _p_value(covariance, places, IDEAL[name])))
    worst = max(idle, key=lambda dropped: dropped.p_value, default=None)
    return worst if worst is not None and worst.p_value > level else None


def _p_value(covariance: Covariance, places: list[int], ideal: float) -> float:
    matrix = covariance.matrix[np.ix_(places, places)]
    if not np.isfinite(matrix).all():
        return 1.0
    off = covariance.values[places] - ideal
    size = float(off @ np.linalg.pinv(matrix, hermitian=True) @ off) / len(places)
    return float(fdtrc(len(places), covariance.freedom, size))
