"""The model that a verdict names: its parameters with 95 % intervals, and how far it predicts."""

from __future__ import annotations

from dataclasses import fields
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.kind_descriptions import meaning, summary
from frictionid.comparison.registry import LAWS
from frictionid.errors import InputError
from frictionid.evaluation.example_motions import FEWEST, jackknife_width
from frictionid.friction import Law
from frictionid.friction.model_files import read_model

from .estimates import digits, interval, mark_of, rounded
from .numbers import MINUS, either, short
from .sections import Model, Section, SummaryData, rollout
from .tables import Cell
from .verdict import Verdict

NEAR = 1e-6  # of a bound, in units of its size


class Row(NamedTuple):
    """A parameter with its unit, and its value at each joint with its 95 % interval, or None."""

    name: str
    unit: str
    values: tuple[Cell | None, ...]


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
    statistics = ("median", "q90", "diverged")
    errors = [
        Horizon(h, *(data.value(model, rollout(h, statistic)) for statistic in statistics))
        for h in data.horizons
    ]
    return [horizon for horizon in errors if np.isfinite(horizon.median)]


def parameter_rows(model: Model, data: SummaryData) -> list[Row]:
    """Friction parameters, one for each row; none of networks and of models without friction.

    Intervals are those of shooting or, for other fits, of the jackknife over the folds.
    """
    joints = model.document.get("joints", ())
    values = _shot(model) if model.refined is not None else _fitted(model)
    rows = []
    for name in dict.fromkeys(name for parameters in joints for name in parameters):
        units = [parameters[name]["unit"] for parameters in joints if name in parameters]
        each = tuple(values.get((j, name)) for j in range(len(data.description.joints)))
        rows.append(Row(name, either(units).replace("^2", "²"), each))
    return rows


def _shot(model: Model) -> dict[tuple[int, str], Cell]:
    """Estimates of shooting; one that data do not determine has no digits."""
    cells = {}
    for e in model.estimates:
        if e.joint is not None:
            mark = mark_of(e)
            words = "at its bound" if e.at_bound else "not identified"
            value = f"{e.value:.2g}" if mark else digits(e.value, e.error)
            beside = words if mark else interval(e.low, e.high, e.error)
            texts = (text.replace("-", MINUS) for text in (value, beside))
            cells[e.joint, e.parameter] = Cell(next(texts), mark=mark, interval=next(texts))
    return cells


def _fitted(model: Model) -> dict[tuple[int, str], Cell]:
    """Values from all data, with the jackknife's intervals where enough folds were fitted."""
    theta = np.asarray(model.theta, dtype=float)
    fitted, bounds, cells = model.role == "fitted", _bounds(model), {}
    for j, parameters in enumerate(model.document.get("joints", ())):
        for i, (name, number) in enumerate(parameters.items()):
            value = float("nan") if number["value"] is None else float(number["value"])
            enough = fitted and len(theta) >= FEWEST
            half = float(jackknife_width(theta[:, j, i])) if enough else float("nan")
            if fitted and name in bounds and _near(value, bounds[name]):
                cell = Cell(f"{value:.3g}", mark="bound", interval="at its bound")
            elif np.isfinite(half) and half > 0:
                middle, low, high = (
                    rounded(v, half / 2) for v in (value, value - half, value + half)
                )
                cell = Cell(middle, interval=f"{low} to {high}")
            else:
                cell = Cell(short(value, 3).replace("-", MINUS))
            cells[j, name] = cell
    return cells


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
