"""Parameters of further specimens, drawn from what was pooled, for domain randomisation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.pooling.random_effects import random_effects
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.report.pooled_document import pooled_document

_GRID = 501  # points of a distribution between the ends of its range


def pooled_draws(document: Mapping[str, Any], count: int, seed: int) -> Array:
    """Samples (count, D) of the pooled parameters: another specimen's, within the 95 % ranges.

    Each parameter by itself: how they go together, a few specimens do not show.
    """
    random = np.random.default_rng(seed)
    out = np.empty((count, len(document["parameters"])))
    for k, e in enumerate(document["parameters"]):
        found = random_effects(np.array(e["values"]), np.array(e["errors"]))
        low, high = e["range_95"]
        x = np.linspace(low, high, _GRID)
        below = found.probability(x)
        out[:, k] = np.interp(random.uniform(below[0], below[-1], count), below, x)
    return out


def sampled(friction: Friction, count: int, seed: int = 0) -> Friction:
    """Friction of so many further specimens, theta (count, n, P), of a pooled friction.

    Raises
    ------
    InputError
        Where the friction is not pooled.
    """
    document = pooled_document(friction)
    if not document:
        raise InputError("sample: the model is not pooled: frictionid pool makes one of several")
    theta = np.repeat(np.asarray(friction.theta, dtype=float)[None], count, axis=0)
    draws = pooled_draws(document, count, seed)
    for e, own in zip(document["parameters"], draws.T, strict=True):
        name = str(e["name"]).rpartition(" of ")[0]
        if e["block"] == "friction" and e["joint"] is not None and name in friction.law.names:
            theta[:, int(e["joint"]), friction.law.names.index(name)] = own
    return Friction(
        *(friction.law, theta, friction.parameters, friction.provenance, friction.position_units),
        load_unit=friction.load_unit,
    )
