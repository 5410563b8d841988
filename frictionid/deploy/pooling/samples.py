"""Parameters of further specimens, drawn from what was pooled, for domain randomisation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.deploy.pooling.random_effects import random_effects

_SINGLE = ("value", "error", "tau", "Q", "p_value")
_PAIRS = ("interval_90", "interval_95", "range_95", "tau_95")
_LARGEST = 1e100  # beyond it squares overflow
_GRID = 501  # points of a distribution between the ends of its range


def pooled_document(friction: Friction) -> Mapping[str, Any]:
    """What pooling wrote into a friction's provenance; empty for others.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    document = friction.provenance.get("pooled") or {}
    if not document:
        return {}
    try:
        entries = [_checked(e, friction.n) for e in document["parameters"]]
        left_out = [str(sentence) for sentence in document["left_out"]]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"the pooled parameters of the model cannot be read: {error}") from None
    return {**document, "parameters": entries, "left_out": left_out}


def _checked(e: Mapping[str, Any], joints: int) -> dict[str, Any]:
    """A pooled parameter whose numbers are numbers."""
    name, joint = str(e["name"]), e["joint"]
    if joint is not None and not 0 <= int(joint) < joints:
        raise ValueError(f"{name} is at no joint of the model")
    pairs = {key: _numbers(e[key], name) for key in _PAIRS}
    single = {key: _numbers([e[key]], name)[0] for key in _SINGLE}
    values, errors = (_numbers(e[key], name) for key in ("values", "errors"))
    models = [str(model) for model in e["models"]]
    alike = len(values) == len(errors) == len(models) > 1 and min(errors) > 0
    if not alike or any(len(p) != 2 or p[0] > p[1] for p in pairs.values()):
        raise ValueError(f"{name} has other numbers than were written")
    words = {key: str(e[key]) for key in ("block", "unit")}
    place = None if joint is None else int(joint)
    more = {"values": values, "errors": errors, "models": models, "joint": place, "name": name}
    return {**words, **pairs, **single, **more, "identified": True, "at_bound": False}


def _numbers(given: Any, name: str) -> list[float]:
    numbers = [float(value) for value in given]
    if not all(abs(value) < _LARGEST for value in numbers):
        raise ValueError(f"{name} is not finite")
    return numbers


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
