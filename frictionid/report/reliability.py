"""Warnings: what a reader must know before trusting the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.results import Results
from frictionid.evaluation import Split

from .sections import Model, Section, SummaryData, rollout
from .tables import lines_of, render

KINDS = {
    "recordings": "whole recordings",
    "blocks": "contiguous blocks",
    "shuffled": "shuffled samples",
}
LOOSE = 0.5  # scatter of a parameter over the folds, in units of its mean
ASTRAY = 0.02  # distance of the fit to all data from the folds' mean curve, in units of its size


def warning_lines(results: Results, sections: Sequence[Section]) -> list[str]:
    """Warnings on a comparison, one text each."""
    context = {
        "results": results,
        "fitted": [section.fitted for section in sections],
        "scored": [data for section in sections for data in section.data],
        "folds": partial(fold_settings, results.provenance),
        "diverged": _diverged,
        "infinite": _infinite,
        "loose": loose,
    }
    tests = {"astray": astray, "loose": loose}
    return lines_of(render("warnings.j2", context, markup=False, tests=tests))


def fold_settings(provenance: Mapping[str, Any], dataset: str) -> Mapping[str, Any]:
    """The settings of folds that a suite has for a data set, else those of all data sets."""
    settings = provenance.get("settings", {})
    for entry in settings.get("datasets", ()):
        name = entry.get("name") or str(entry.get("path", "")).rpartition("/")[2]
        if name == dataset and entry.get("folds"):
            return dict(entry["folds"])
    return dict(settings.get("folds", {}))


def folds_of(results: Results, section: Section) -> str:
    """The folds of a data set in words."""
    settings = fold_settings(results.provenance, section.dataset)
    if "count" not in settings:
        return "judged on held-out data"
    kind = Split(kind=settings.get("kind")).kind_of(section.description.recordings)
    gaps = f" with gaps of {settings['gap']:g} s" if kind == "blocks" else ""
    return f"{settings['count'] or ''} folds of {KINDS[kind]}{gaps}".strip()


def _diverged(data: SummaryData, *roles: str) -> list[float]:
    """Shares of predictions that diverged after the last reported horizon, of models of roles."""
    column = rollout(data.reported[-1], "diverged") if data.reported else ""
    return [data.value(model, column) for model in data.of_role(*roles)]


def _infinite(data: SummaryData) -> list[str]:
    """Names of models with an infinite score."""
    lost = [frame[np.isinf(frame).any(axis=1)] for frame in (data.level, data.folds)]
    tasks = {task for frame in lost for task in frame.index.get_level_values("task")}
    return [model.name for model in data.models if model.task in tasks]


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


def loose(model: Model) -> int:
    """How many parameters scatter over the folds by more than half their mean.

    Those of networks and of models without physics do, whatever they are worth: they count as none.
    """
    if len(model.theta) < 2 or "joints" not in model.document or model.document.get("mechanism"):
        return 0
    sd, mean = model.theta.std(axis=0, ddof=1), np.abs(model.theta.mean(axis=0))
    return int((sd > LOOSE * mean).sum())
