"""Whether a lower one-step loss comes with a better prediction, and with a truer friction curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.report.figures.panels import plain_logarithm
from frictionid.report.figures.style import (
    DARK,
    DASHED,
    GRID,
    Style,
    figure,
    key_above,
    marker,
)
from frictionid.report.sections import EULER, Model, Section, rollout

MARKERS = {"none": "s", "given": "D", "truth": "*"}  # others have those of their recipes
RECIPES = ("o", "^", "v", "P", "X", "<", ">", "p")


def loss_against(section: Section, styles: Mapping[str, Style]) -> Any:
    """Rollout error and curve error over one-step loss, a point for each model."""
    data, description = section.fitted, section.description
    unit, horizon = description.angle_unit, data.horizons[-1]
    errors = {model: data.value(model, rollout(horizon)) for model in section.models}
    curves = {
        model: 100 * float(np.mean(data.curve_errors(model)))
        for model in section.models
        if model.role != "truth"
    }
    panels = {
        f"{description.coordinate} error after {horizon:g} s [{unit}]": errors,
        "curve error, mean of joints [%]": curves,
    }
    names = list(styles)
    picture = figure(2.7)
    for axis, (label, heights) in zip(picture.subplots(1, 2), panels.items(), strict=True):
        for model in section.models:
            # points on the same spot become rings around each other
            size = max(10 - 1.5 * names.index(model.label), 4.0)
            height = heights.get(model, float("nan"))
            _point(axis, section, model, (height, size), styles[model.label].colour)
        axis.set_xlabel(f"one-step loss, euler [{unit}/s]")
        axis.set_ylabel(label)
        axis.grid(**GRID)
        plain_logarithm(axis)
    key_above(picture, _key(section, styles), 0.8)
    return picture


def _point(
    axis: Any, section: Section, model: Model, place: tuple[float, float], colour: str
) -> None:
    """A model's point at its loss, with the marker of its recipe; `place`: its height and size."""
    height, size = place
    loss = section.fitted.value(model, EULER)
    if model.role == "truth" and np.isfinite(loss):
        axis.axvline(loss, color=DARK, linewidth=1, linestyle=DASHED, zorder=1)
    if not np.isfinite([loss, height]).all() or height <= 0:
        return
    axis.plot(
        loss,
        height,
        MARKERS.get(model.role) or _marker(section, model.recipe),
        color=colour,
        markerfacecolor="white" if _hollow(section, model.recipe) else colour,
        markeredgewidth=1.3,
        markersize={"none": 6, "truth": 9}.get(model.role, size),
    )


def _key(section: Section, styles: Mapping[str, Style]) -> dict[str, Any]:
    roles = {model.label: MARKERS.get(model.role, "o") for model in section.models}
    key = {name: marker(styles[name].colour, kind, 5) for name, kind in roles.items()}
    for recipe in section.recipes if len(section.recipes) > 1 else ():
        face = "white" if _hollow(section, recipe) else "black"
        key[f"{recipe} recipe"] = marker("black", _marker(section, recipe), 6, face)
    return key


def _marker(section: Section, recipe: str) -> str:
    """Each recipe has its own, the first two are dots."""
    place = section.recipes.index(recipe) if recipe in section.recipes else 0
    return RECIPES[max(place - 1, 0) % len(RECIPES)]


def _hollow(section: Section, recipe: str) -> bool:
    return len(section.recipes) > 1 and recipe == section.recipes[0]
