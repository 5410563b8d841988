"""The true friction of simulated recordings, from the [truth] table of their data set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.laws import AsymmetricStribeck

MEMORY_FREE = "stribeck"


def steady_state(truth: Mapping[str, Any], width: float = 1e-6) -> Friction:
    """True steady-state friction: the curve that every kind of truth follows at constant speed.

    Raises
    ------
    InputError
        Where the table does not hold one finite number for each parameter and joint.
    """
    law = AsymmetricStribeck(width=width)
    missing = [name for name in law.names if name not in truth]
    if missing:
        raise InputError(f"[truth] lacks {', '.join(missing)}")
    for name in law.names:
        if np.shape(truth[name]) != np.shape(truth[law.names[0]]) or not _numbers(truth[name]):
            raise InputError(f"[truth] {name} = {truth[name]!r} must be one number for each joint")
    columns = [np.asarray(truth[name], dtype=float) for name in law.names]
    return Friction(law, np.stack(columns, axis=-1), provenance={"source": "truth"})


def _numbers(values: Any) -> bool:
    if not isinstance(values, list | tuple) or not values:
        return False
    return {type(value) for value in values} <= {int, float} and bool(np.isfinite(values).all())


def true_friction(truth: Mapping[str, Any]) -> Friction | None:
    """True friction as a model that can be scored; None for a truth with memory."""
    if truth.get("kind") != MEMORY_FREE:
        return None
    return steady_state(truth, AsymmetricStribeck().width)
