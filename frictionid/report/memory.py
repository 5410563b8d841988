"""Analysis of memory: why a model with memory beats one without, one step ahead.

The advantage of the best model with memory over the best without is read under recipes whose data
are calibrated by shooting: the clock of the torque, the inertia. What a correction takes away was
never memory; what the corrected recipes leave may be.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from frictionid.evaluation.statistics import Pair
from frictionid.report.loops import has_memory
from frictionid.report.sections import EULER, Model, SummaryData, rollout

BOTH = frozenset(("delay", "inertia"))


class Method(NamedTuple):
    """Scheme of a recipe, and what of a calibration corrects its data."""

    scheme: str
    corrects: frozenset[str]


RAW = Method("euler", frozenset())


@dataclass(frozen=True)
class Advantage:
    """The best models without and with memory under one method, and the error that memory saves."""

    static: Model
    dynamic: Model
    pair: Pair


@dataclass(frozen=True)
class MemoryAnalysis:
    """What the advantage of memory consists of.

    Attributes
    ----------
    losses : models and their mean losses: no friction, without memory, with memory
    in_order, folds : in how many folds the losses fall in this order, of how many
    raw : advantage where nothing is corrected
    shares : what each correction takes off it, see `_shares`
    method, remaining : the method that leaves the fewest other reasons, and the advantage there
    rollouts : horizons [s], and the error that memory saves in predictions there
    """

    losses: tuple[tuple[Model, float], ...]
    in_order: int
    folds: int
    raw: Advantage
    shares: Mapping[str, float]
    method: Method
    remaining: Advantage
    rollouts: tuple[tuple[float, Pair], ...]


def memory_analysis(data: SummaryData) -> MemoryAnalysis | None:
    """The analysis; None where models with and without memory are missing under an Euler recipe."""
    advantages = _advantages(data)
    if RAW not in advantages:
        return None
    raw = advantages[RAW]
    method = max(advantages, key=lambda m: (len(m.corrects & BOTH), m.scheme == "integral"))
    remaining = advantages[method]
    models = [*data.of_role("none")[:1], raw.static, raw.dynamic]
    each = [data.of_folds(model, EULER) for model in models]
    same = len({len(own) for own in each}) == 1 and len(each[0]) > 0
    pairs = [
        (h, data.paired(remaining.static, remaining.dynamic, rollout(h))) for h in data.reported
    ]
    return MemoryAnalysis(
        losses=tuple(zip(models, (float(own.mean()) for own in each), strict=True)) if same else (),
        in_order=int((np.diff(each, axis=0) < 0).all(axis=0).sum()) if same else 0,
        folds=len(each[0]),
        raw=raw,
        shares=_shares({m: advantage.pair.mean for m, advantage in advantages.items()}),
        method=method,
        remaining=remaining,
        rollouts=tuple(p for p in pairs if p[1].clear is not None) if method.corrects else (),
    )


def _advantages(data: SummaryData) -> dict[Method, Advantage]:
    """The advantage of memory under each method."""
    by_method: dict[Method, list[Model]] = {}
    for model in data.of_role("fitted"):
        if model.method.get("scheme") in ("euler", "integral"):
            key = Method(model.method["scheme"], frozenset(model.method.get("corrects", ())))
            by_method.setdefault(key, []).append(model)
    out = {}
    for key, models in by_method.items():
        static = data.best([m for m in models if not has_memory(m)], EULER)
        dynamic = data.best([m for m in models if has_memory(m)], EULER)
        if static is not None and dynamic is not None:
            out[key] = Advantage(static, dynamic, data.paired(static, dynamic, EULER))
    return out


def _shares(ahead: Mapping[Method, float]) -> dict[str, float]:
    """What the corrections take off the advantage of memory [rad/s], by their names.

    With a, d, i, b the advantage uncorrected, with the delay, the inertia, and both corrected:
    delay (a - d + i - b) / 2, inertia (a - i + d - b) / 2, the mean over both orders; where only
    both are known together, a - b. "scheme" is what the integral scheme takes off b, as it has
    neither the noise of differences nor the Euler step.
    """
    raw = ahead[RAW]
    delay, inertia, both = (
        ahead.get(Method("euler", frozenset(part))) for part in (["delay"], ["inertia"], BOTH)
    )
    integral = ahead.get(Method("integral", BOTH))
    out: dict[str, float] = {}
    if delay is not None and inertia is not None and both is not None:
        out["delay"] = (raw - delay + inertia - both) / 2
        out["inertia"] = (raw - inertia + delay - both) / 2
    elif both is not None:
        out["delay and inertia"] = raw - both
    if integral is not None and both is not None:
        out["scheme"] = both - integral
    elif integral is not None:
        out["delay, inertia and scheme"] = raw - integral
    return out
