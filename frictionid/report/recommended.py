"""The model that a verdict names: its parameters with 95 % intervals, and how far it predicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.kind_descriptions import meaning, summary
from frictionid.comparison.registry import LAWS
from frictionid.errors import InputError
from frictionid.evaluation.example_motions import FEWEST, jackknife_width
from frictionid.friction import Law
from frictionid.friction.model_files import read_model
from frictionid.friction.provenance import Estimate
from frictionid.report.estimates import digits, interval, mark_of, rounded
from frictionid.report.numbers import MINUS, either, short
from frictionid.report.sections import Model, Section, SummaryData, rollout
from frictionid.report.verdict import Verdict

NEAR = 1e-6  # of a bound, in units of its size


class Value(NamedTuple):
    """A parameter of a joint as text: value, 95 % interval, and a mark or ""."""

    text: str
    interval: str = ""
    mark: str = ""


class Row(NamedTuple):
    """A parameter with its unit, and its value at each joint; None where a joint has none."""

    name: str
    unit: str
    values: tuple[Value | None, ...]


class Horizon(NamedTuple):
    """Errors after a horizon [s] as text: median, 90 % quantile, share that diverged."""

    seconds: float
    median: float
    q90: float
    diverged: float


def chosen_of(section: Section, verdict: Verdict) -> Model | None:
    """The model that the verdict names; without one the fitted model that predicts best."""
    candidate = verdict.candidate(verdict.provisional)
    if candidate is not None:
        return candidate.model
    data = section.fitted
    last = rollout(data.reported[-1]) if data.reported else ""
    return data.best(data.of_role("fitted"), last)


def equation_of(model: Model) -> str:
    """Equation of a model's law in words and symbols, "" where its law is not one of ours."""
    table = model.document.get("law", {})
    law = LAWS.get(str(table.get("kind", "")))
    if law is None:
        return ""
    family = [summary(part) for part in law.__mro__ if issubclass(part, Law)]
    equations = [text for text in family if text.startswith("Tf")]
    switched = [
        f"{field.name} = {meaning(law, field.name)}."
        for field in fields(law)
        if isinstance(field.default, bool) and table.get(field.name, field.default) != field.default
    ]
    words = dict.fromkeys([family[0], *equations[:1], *switched])
    return " ".join(words).replace("`", "")


def horizons_of(data: SummaryData, model: Model) -> list[Horizon]:
    """Errors of a model after each horizon at which it was scored."""
    out = []
    for h in data.horizons:
        values = (data.value(model, rollout(h, s)) for s in ("median", "q90", "diverged"))
        out.append(Horizon(h, *values))
    return [own for own in out if np.isfinite(own.median)]


def parameter_rows(model: Model, data: SummaryData) -> list[Row]:
    """Friction parameters, one for each row; none of networks and of models without friction.

    Intervals are those of shooting or, for other fits, of the jackknife over the folds.
    """
    joints = model.document.get("joints", ())
    names = list(dict.fromkeys(name for own in joints for name in own))
    values = _shot(model) if model.refined is not None else _fitted(model)
    rows = []
    for name in names:
        units = [own[name]["unit"] for own in joints if name in own]
        each = tuple(values.get((j, name)) for j in range(len(data.description.joints)))
        rows.append(Row(name, either(units).replace("^2", "²"), each))
    return rows


def _shot(model: Model) -> dict[tuple[int, str], Value]:
    return {(e.joint, e.parameter): shown(e) for e in model.estimates if e.joint is not None}


def shown(e: Estimate) -> Value:
    """An estimate of shooting with its interval; one that data do not determine has no digits."""
    mark = mark_of(e)
    if mark:
        words = "at its bound" if e.at_bound else "not identified"
        return Value(f"{e.value:.2g}".replace("-", MINUS), words, mark)
    text = digits(e.value, e.error).replace("-", MINUS)
    return Value(text, interval(e.low, e.high, e.error).replace("-", MINUS))


def _fitted(model: Model) -> dict[tuple[int, str], Value]:
    """Values from all data, with the jackknife's intervals where enough folds were fitted."""
    theta = np.asarray(model.theta, dtype=float)
    known = model.role == "fitted" and len(theta) >= FEWEST
    bounds = _bounds(model)
    out = {}
    for j, i, name, number in _numbers(model):
        value = float("nan") if number["value"] is None else float(number["value"])
        half = float(jackknife_width(theta[:, j, i])) if known else float("nan")
        if name in bounds and model.role == "fitted" and _near(value, bounds[name]):
            out[j, name] = Value(f"{value:.3g}", "at its bound", "bound")
        elif np.isfinite(half) and half > 0:
            low, high = (rounded(v, half / 2) for v in (value - half, value + half))
            out[j, name] = Value(rounded(value, half / 2), f"{low} to {high}")
        else:
            out[j, name] = Value(short(value, 3).replace("-", MINUS))
    return out


def _numbers(model: Model) -> Iterator[tuple[int, int, str, Mapping[str, Any]]]:
    for j, own in enumerate(model.document.get("joints", ())):
        for i, (name, number) in enumerate(own.items()):
            yield j, i, name, number


def _bounds(model: Model) -> dict[str, Array]:
    """Ends of each parameter's range by its name; nothing where the law is one's own."""
    try:
        law = read_model(model.document, LAWS, model.name).law
    except (InputError, LookupError, TypeError, ValueError):
        return {}
    ends = np.asarray(law.bounds, dtype=float).reshape(-1, 2)
    return dict(zip(law.names, ends, strict=False))


def _near(value: float, ends: Array) -> bool:
    finite = ends[np.isfinite(ends)]
    return bool((np.abs(value - finite) <= NEAR * np.maximum(np.abs(finite), 1e-3)).any())
