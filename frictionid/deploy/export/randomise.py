"""Parameters for domain randomisation: their joint distribution as ranges and samples."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.export.exported import ExportedFriction
from frictionid.deploy.pooling.random_effects import pooled_draws
from frictionid.errors import InputError
from frictionid.friction import Friction
from frictionid.report.estimates import pooled_document

FORMAT = "frictionid samples 1"
_FEWEST = 200  # draws behind the ranges of an engine's own numbers
Held = Callable[[ExportedFriction], Friction]


def randomised(own: ExportedFriction, count: int, seed: int = 0, held: Held | None = None) -> bytes:
    """JSON with 95 % ranges of all fitted parameters, and `count` samples of them together.

    Samples are normal with the fit's covariance, cut to the law's bounds and to what the ranges
    leave open to one side; of a pooled model they are further specimens, within the ranges of
    these. Parameters that the data do not determine stay at their values.

    Parameters
    ----------
    own : ExportedFriction
    count : int
    seed : int
    held : function, optional
        Friction that an engine holds of a model: its numbers are given of each sample, too.

    Raises
    ------
    InputError
        For models without a covariance.
    """
    entries, draws = _distribution(own.friction, max(count, _FEWEST), seed)
    thetas = _thetas(own.friction, entries, draws)
    content: dict[str, Any] = {
        "format": FORMAT,
        "law": str(own.law),
        "joints": list(own.joints),
        "seed": seed,
        "parameters": [_entry(e, fixed=not np.ptp(draws[:, k])) for k, e in enumerate(entries)],
        "samples": draws[:count].tolist(),
    }
    if held is not None:
        content["engine"] = _engine(own, thetas, held, count)
    return (json.dumps(content, indent=1) + "\n").encode()


def _distribution(friction: Friction, count: int, seed: int) -> tuple[Any, Array]:
    """Parameters with their 95 % ranges, and samples (count, D) of them."""
    several = pooled_document(friction)
    if several:
        entries = [{**e, "interval_95": e["range_95"]} for e in several["parameters"]]
        return entries, pooled_draws(several, count, seed)
    document = friction.provenance.get("refined")
    if not isinstance(document, Mapping) or not document.get("parameters"):
        raise InputError(
            "randomise: the model has no covariance of its parameters: fit by shooting "
            "(--by shooting), or pool models of several specimens (frictionid pool); the "
            "intervals of one-step fits hold the noise alone"
        )
    return document["parameters"], drawn(document, count, seed)


def drawn(document: Mapping[str, Any], count: int, seed: int) -> Array:
    """Samples (count, D) of the parameters of a result document of shooting.

    >>> entry = {"value": 1.0, "interval_95": [0.0, 3.0], "at_bound": False}
    >>> drawn({"parameters": [entry], "covariance": [[1.0]]}, 3, 0).round(3)[:, 0]
    array([1.126, 0.868, 1.64 ])
    """
    entries = document["parameters"]
    value = np.array([float(e["value"]) for e in entries])
    covariance = np.asarray(document["covariance"], dtype=float).reshape(2 * [len(entries)])
    variance = np.diag(covariance)
    free = np.isfinite(variance) & (variance > 0) & [not e["at_bound"] for e in entries]
    part = covariance[np.ix_(free, free)]
    size, turn = np.linalg.eigh(part)
    normal = np.random.default_rng(seed).standard_normal((count, len(part)))
    out = np.repeat(value[None], count, axis=0)
    out[:, free] += normal * np.sqrt(np.maximum(size, 0.0)) @ turn.T
    low, high = np.array([e["interval_95"] for e in entries], dtype=float).T
    # where an interval ends at zero, the parameter does
    return np.clip(out, np.where(low == 0, 0.0, -np.inf), np.where(high == 0, 0.0, np.inf))


def _thetas(friction: Friction, entries: Any, draws: Array) -> Array:
    """Parameters (N, n, P) of the law in each draw, within its bounds."""
    out = np.repeat(np.asarray(friction.theta, dtype=float)[None], len(draws), axis=0)
    for k, entry in enumerate(entries):
        name = str(entry["name"]).rpartition(" of ")[0]
        if entry["block"] == "friction" and entry["joint"] is not None:
            if name not in friction.law.names:
                raise InputError(
                    f"randomise: {type(friction.law).__name__} has parameters of its own for each "
                    f"joint ({entry['name']}): fit one law for all"
                )
            out[:, int(entry["joint"]), friction.law.names.index(name)] = draws[:, k]
    low, high = np.array(friction.law.bounds).T
    return np.clip(out, low, high)


def _entry(entry: Mapping[str, Any], *, fixed: bool) -> dict[str, Any]:
    low, high = (float(v) for v in entry["interval_95"])
    ends = (None if fixed else v for v in (low, high))
    names = dict(zip(("low_95", "high_95"), ends, strict=True))
    return {
        **{k: entry[k] for k in ("block", "name", "joint", "unit", "value")},
        **names,
        "fixed": fixed,
    }


def _engine(own: ExportedFriction, thetas: Array, held: Held, count: int) -> dict[str, Any]:
    """What the engine's numbers are in each draw, with their 95 % ranges."""
    middle = held(own)
    each = np.stack([held(own.with_theta(theta)).theta for theta in thetas])
    low, high = np.quantile(each, (0.025, 0.975), axis=0)
    parameters = [
        {
            "name": f"{name} of {joint}",
            "value": float(middle.theta[j, i]),
            "low_95": float(low[j, i]),
            "high_95": float(high[j, i]),
        }
        for j, joint in enumerate(own.joints)
        for i, name in enumerate(middle.law.names)
    ]
    samples = each[:count].reshape(min(count, len(each)), -1).tolist()
    return {"law": str(middle.law), "parameters": parameters, "samples": samples}
