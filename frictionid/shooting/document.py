"""What shooting found, as numbers and words for files, tables and pictures."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.shooting.refine import Refined

LEVELS = (0.9, 0.95)


def document_of(result: Refined, grid: Array) -> dict[str, Any]:
    """Parameters with intervals, correlation, bands on a velocity grid (V, n), and how it went."""
    covariance, went = result.covariance, result.diagnostics
    intervals = {level: covariance.interval(level) for level in LEVELS}
    identified, error = covariance.identified, covariance.error
    parameters = [
        {
            "block": entry.block,
            "name": entry.name,
            "unit": entry.unit,
            "joint": entry.place[0] if entry.block != "inertia" and entry.place else None,
            "value": float(covariance.values[k]),
            "error": float(error[k]),
            **{f"interval_{round(100 * v)}": ends[k].tolist() for v, ends in intervals.items()},
            "at_bound": bool(covariance.bound[k]),
            "identified": bool(identified[k]),
        }
        for k, entry in enumerate(covariance.entries)
    ]
    pointwise, simultaneous = result.bands(grid)
    return {
        "parameters": parameters,
        "correlation": np.asarray(covariance.correlation),
        "covariance": np.asarray(covariance.matrix),
        "freedom": covariance.freedom,
        "clusters": covariance.clusters,
        "singular_values": covariance.singular,
        "undetermined": list(covariance.undetermined),
        "bands": {"level": 0.95, "pointwise": pointwise, "simultaneous": simultaneous},
        "angle_noise": went.sigma,
        "windows": went.windows,
        "left_out": [place._asdict() for place in went.left_out],
        "unexplained": [place._asdict() for place in went.unexplained],
        "settled": went.settled,
        "iterations": went.iterations,
    }
