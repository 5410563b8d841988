"""Warnings: what a reader must know before trusting the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.results import Results
from frictionid.report.numbers import divergence_limit, percent, seconds
from frictionid.report.sections import Model, Section, SummaryData, rollout

LOOSE = 0.5  # scatter of a parameter over the folds, in units of its mean
ASTRAY = 0.02  # distance of the fit to all data from the folds' mean curve, in units of its size


def warning_lines(results: Results, sections: Sequence[Section]) -> list[str]:
    """Warnings on a comparison, one text each."""
    fitted = [section.fitted for section in sections]
    scored = [data for section in sections for data in section.data]
    lines = [_unfinished(results)]
    lines += [_shuffled(data, results.provenance) for data in fitted]
    lines += map(_diverged, scored)
    lines += map(_infinite, scored)
    lines += map(_astray, fitted)
    lines += map(_loose, fitted)
    lines += map(_without_truth, fitted)
    return list(filter(None, lines))


def fold_settings(provenance: Mapping[str, Any], dataset: str) -> Mapping[str, Any]:
    """The settings of folds that a suite has for a data set, else those of all data sets."""
    settings = provenance.get("settings", {})
    for entry in settings.get("datasets", ()):
        name = entry.get("name") or str(entry.get("path", "")).rpartition("/")[2]
        if name == dataset and entry.get("folds"):
            return dict(entry["folds"])
    return dict(settings.get("folds", {}))


def _unfinished(results: Results) -> str:
    if not results.missing:
        return ""
    return (
        f"Unfinished: {len(results.missing)} of {len(results.provenance['tasks'])} tasks; their "
        "lines are missing. Finish them with frictionid compare --resume."
    )


def _shuffled(data: SummaryData, provenance: Mapping[str, Any]) -> str:
    if fold_settings(provenance, data.dataset).get("kind") != "shuffled":
        return ""
    return (
        f"Shuffled folds on {data.dataset}: held-out samples have neighbours in the training set. "
        "Losses flatter models that interpolate, and rollouts are not held out at all."
    )


def _diverged(data: SummaryData) -> str:
    """Diverged predictions of fitted and given models after the last reported horizon."""
    column = rollout(data.reported[-1], "diverged") if data.reported else ""
    shares = [data.value(model, column) for model in data.of_role("fitted", "given")]
    if not any(share > 0 for share in shares):
        return ""
    without = [data.value(model, column) for model in data.of_role("none")[:1]]
    beside = "".join(f", without friction {percent(share)}" for share in without)
    limit = divergence_limit(data.description.angle_unit)
    return (
        f"Diverged predictions on {data.dataset} after {seconds(data.reported[-1])} (further off "
        f"than {limit}, which medians hide): up to {percent(float(np.nanmax(shares)))}{beside}."
    )


def _infinite(data: SummaryData) -> str:
    names = ", ".join(model.name for model in data.models if _has_infinite(data, model))
    return names and f"Infinite errors on {data.dataset}, shown as ∞ and in no average: {names}."


def _has_infinite(data: SummaryData, model: Model) -> bool:
    frames = (f[f.index.get_level_values("task") == model.task] for f in (data.level, data.folds))
    return any(bool(np.isinf(frame.to_numpy()).any()) for frame in frames)


def _astray(data: SummaryData) -> str:
    names = ", ".join(model.name for model in data.of_role("fitted") if astray(model))
    return names and (
        f"Fit to all data outside the scatter of the folds' curves on {data.dataset}, perhaps "
        f"another minimum: {names}."
    )


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


def _loose(data: SummaryData) -> str:
    counts = {model: loose(model) for model in data.of_role("fitted")}
    models = ", ".join(
        f"{model.name} {count} of {model.theta[0].size}" for model, count in counts.items() if count
    )
    return models and (
        "Parameters that scatter over the folds by more than half their mean on "
        f"{data.dataset} (not determined one by one, even where the curve is): {models}."
    )


def loose(model: Model) -> int:
    """How many parameters scatter over the folds by more than half their mean.

    Those of networks and of models without physics do, whatever they are worth: they count as none.
    """
    if len(model.theta) < 2 or "joints" not in model.document or model.document.get("mechanism"):
        return 0
    sd, mean = model.theta.std(axis=0, ddof=1), np.abs(model.theta.mean(axis=0))
    return int((sd > LOOSE * mean).sum())


def _without_truth(data: SummaryData) -> str:
    if not data.description.true_joints or data.of_role("truth"):
        return ""
    return (
        f"True friction of {data.dataset}: only the curve at steady speed is compared, the truth "
        "has no row of its own."
    )
