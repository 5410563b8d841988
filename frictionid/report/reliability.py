"""Warnings: what a reader must know before trusting the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.results import Results
from frictionid.report.numbers import divergence_limit, percent, seconds
from frictionid.report.sections import Model, Section, SummaryData, rollout

LOOSE = 0.5  # scatter of a parameter over the folds, in units of its mean
ASTRAY = 0.02  # distance of the fit to all data from the folds' mean curve, in units of its size


@dataclass(frozen=True)
class Diverged:
    """The largest share of diverged predictions on one data set, and that without friction."""

    dataset: str
    horizon: float
    angle_unit: str
    share: float
    without: float | None


@dataclass(frozen=True)
class Warnings:
    """What to read with care.

    Attributes
    ----------
    missing, tasks : number of unfinished tasks, and of all
    shuffled : fitted data sets whose folds are shuffled samples
    diverged : data sets on which predictions diverged after the last horizon
    infinite : models with infinite errors, by the data set
    astray : models whose fit to all data lies outside the scatter of the folds, by the data set
    loose : models with the number of parameters that scatter, and of all, by the data set
    without_truth : data sets whose true friction has no scores of its own
    """

    missing: int
    tasks: int
    shuffled: tuple[str, ...]
    diverged: tuple[Diverged, ...]
    infinite: tuple[tuple[str, list[Model]], ...]
    astray: tuple[tuple[str, list[Model]], ...]
    loose: tuple[tuple[str, list[tuple[Model, int, int]]], ...]
    without_truth: tuple[str, ...]

    def __bool__(self) -> bool:
        """Whether there is anything to read with care."""
        return any(value for name, value in vars(self).items() if name != "tasks")


def warnings_of(results: Results, sections: Sequence[Section]) -> Warnings:
    """Warnings on a comparison."""
    fitted = [section.fitted for section in sections]
    scored = [data for section in sections for data in section.data]
    return Warnings(
        missing=len(results.missing),
        tasks=len(results.provenance["tasks"]),
        shuffled=tuple(
            data.dataset
            for data in fitted
            if fold_settings(results.provenance, data.dataset).get("kind") == "shuffled"
        ),
        diverged=tuple(found for data in scored if (found := diverged(data)) is not None),
        infinite=_by_dataset(scored, lambda data, m: [m] if _infinite(data, m) else []),
        astray=_by_dataset(fitted, lambda _, m: [m] if m.role == "fitted" and astray(m) else []),
        loose=_by_dataset(fitted, lambda _, m: _loose(m)),
        without_truth=tuple(
            data.dataset
            for data in fitted
            if data.description.true_joints and not data.of_role("truth")
        ),
    )


def fold_settings(provenance: Mapping[str, Any], dataset: str) -> Mapping[str, Any]:
    """The settings of folds that a suite has for a data set: its own, or those of all."""
    settings = provenance.get("settings", {})
    for entry in settings.get("datasets", ()):
        name = entry.get("name") or str(entry.get("path", "")).rpartition("/")[2]
        if name == dataset and entry.get("folds"):
            own: Mapping[str, Any] = entry["folds"]
            return own
    common: Mapping[str, Any] = settings.get("folds", {})
    return common


def _by_dataset(data: Sequence[SummaryData], found: Any) -> tuple[tuple[str, list[Any]], ...]:
    """What is found on the models of each data set; those of which nothing is are left out."""
    every = [(d.dataset, [entry for m in d.models for entry in found(d, m)]) for d in data]
    return tuple((dataset, entries) for dataset, entries in every if entries)


def diverged(data: SummaryData) -> Diverged | None:
    """Diverged predictions of fitted and given models after the last reported horizon."""
    if not data.reported:
        return None
    column = rollout(data.reported[-1], "diverged")
    shares = [data.value(model, column) for model in data.of_role("fitted", "given")]
    if not any(share > 0 for share in shares):
        return None
    without = [data.value(model, column) for model in data.of_role("none")]
    unit, worst = data.description.angle_unit, float(np.nanmax(shares))
    return Diverged(data.dataset, data.reported[-1], unit, worst, without[0] if without else None)


def _infinite(data: SummaryData, model: Model) -> bool:
    own = [f[f.index.get_level_values("task") == model.task] for f in (data.level, data.folds)]
    return any(bool(np.isinf(frame.to_numpy()).any()) for frame in own)


def astray(model: Model) -> bool:
    """Whether a joint's curve from all data is further from the folds' mean than every fold's."""
    folds, overall = model.curves[:-1], model.curves[-1]
    if len(folds) < 2 or not np.isfinite(model.curves).all():
        return False
    mean = folds.mean(axis=0)
    size, off = _rms(mean), _rms(overall - mean)
    return bool(((off > _rms(folds - mean).max(axis=0)) & (off > ASTRAY * size)).any())


def _rms(curves: Array) -> Array:
    """Root mean square over the velocities, the last axis but one."""
    return np.sqrt(np.mean(np.square(curves), axis=-2))


def _loose(model: Model) -> list[tuple[Model, int, int]]:
    count = loose(model) if model.role == "fitted" else 0
    return [(model, count, model.theta[0].size)] if count else []


def loose(model: Model) -> int:
    """How many parameters scatter over the folds by more than half their mean.

    Those of networks and of models without physics do, whatever they are worth: they count as none.
    """
    if len(model.theta) < 2 or "joints" not in model.document or model.document.get("mechanism"):
        return 0
    sd, mean = model.theta.std(axis=0, ddof=1), np.abs(model.theta.mean(axis=0))
    return int((sd > LOOSE * mean).sum())


def warning_lines(found: Warnings) -> list[str]:
    """Warnings in words, one text each."""
    out = []
    if found.missing:
        out.append(
            f"Unfinished: {found.missing} of {found.tasks} tasks; their lines are missing. Finish "
            "them with frictionid compare --resume."
        )
    out += [
        f"Shuffled folds on {dataset}: held-out samples have neighbours in the training set. "
        "Losses flatter models that interpolate, and rollouts are not held out at all."
        for dataset in found.shuffled
    ]
    out += map(_diverged_line, found.diverged)
    out += [
        f"Infinite errors on {dataset}, shown as ∞ and in no average: {_names(models)}."
        for dataset, models in found.infinite
    ]
    out += [
        f"Fit to all data outside the scatter of the folds' curves on {dataset}, perhaps another "
        f"minimum: {_names(models)}."
        for dataset, models in found.astray
    ]
    for dataset, counts in found.loose:
        models = ", ".join(f"{model.name} {count} of {total}" for model, count, total in counts)
        out.append(
            "Parameters that scatter over the folds by more than half their mean on "
            f"{dataset} (not determined one by one, even where the curve is): {models}."
        )
    out += [
        f"True friction of {dataset}: only the curve at steady speed is compared, the truth has no "
        "row of its own."
        for dataset in found.without_truth
    ]
    return out


def _diverged_line(found: Diverged) -> str:
    without = ""
    if found.without is not None:
        without = f", without friction {percent(found.without)}"
    return (
        f"Diverged predictions on {found.dataset} after {seconds(found.horizon)} (further off than "
        f"{divergence_limit(found.angle_unit)}, which medians hide): up to "
        f"{percent(found.share)}{without}."
    )


def _names(models: Sequence[Model]) -> str:
    return ", ".join(model.name for model in models)
