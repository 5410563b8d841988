"""Learning curves: the loss over the epochs, of each fold, in training and on what it held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.panels import panel_grid, plain_logarithm
from frictionid.report.figures.style import DARK, GREY, Style, key_above, line, marker, plain
from frictionid.report.sections import Model

COLUMNS = 3
PARTS = ("training", "held_out")


def losses_of(model: Model) -> Mapping[str, Array] | None:
    """Losses (F, E) of a model that learned in epochs, without the fit to all data; else None."""
    learning = model.document.get("provenance", {}).get("learning") or {}
    parts = {key: np.asarray(learning[key], dtype=float) for key in PARTS if key in learning}
    return {key: value[: max(len(value) - 1, 1)] for key, value in parts.items()} or None


def learning_curves(models: Sequence[Model], styles: Mapping[str, Style], unit: str) -> Any:
    """Picture of all that learned in epochs, a panel for each; None where nothing did."""
    shown = [(model, losses) for model in models if (losses := losses_of(model))]
    if not shown:
        return None
    picture, axes = panel_grid(len(shown), COLUMNS, 1.8, 0.6)
    for axis, (model, losses) in zip(axes, shown, strict=True):
        own = styles[model.label].colour
        for part, values in losses.items():
            colour = own if part == "held_out" else GREY
            epochs = np.arange(1, values.shape[1] + 1)
            axis.plot(epochs, values.T, color=colour, linewidth=0.6, alpha=0.6)
        if "held_out" in losses:
            _ends(axis, losses["held_out"])
        plain_logarithm(axis)
        axis.xaxis.get_major_locator().set_params(integer=True)
        axis.set_title(plain(model.name), fontsize=7, loc="left", color=own)
    picture.supxlabel("epoch", fontsize=8)
    picture.supylabel(f"loss {unit}", fontsize=8)
    key = {
        "training, each fold": line(GREY),
        "held out in the fold": line(styles[shown[0][0].label].colour),
        "kept": marker(DARK, "."),
    }
    key_above(picture, key)
    return picture


def _ends(axis: Any, losses: Array) -> None:
    """A dot where each fold was best."""
    for values in losses:
        known = np.where(np.isfinite(values), values, np.inf)
        best = int(known.argmin())
        if np.isfinite(known[best]):
            axis.plot(best + 1, known[best], ".", color=DARK, markersize=4, zorder=5)
