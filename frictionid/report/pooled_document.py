"""What pooling writes into the provenance of a friction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from frictionid.errors import InputError
from frictionid.friction import Friction

_SINGLE = ("value", "error", "tau", "Q", "p_value")
_PAIRS = ("interval_90", "interval_95", "range_95", "tau_95")
_LARGEST = 1e100  # beyond it squares overflow


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
