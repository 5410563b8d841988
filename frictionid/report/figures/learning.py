"""Learning curves: the loss over the epochs, of each fold, in training and on what it held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import DARK, GREY, Look, figure, key_above, plain
from frictionid.report.load import Entry

COLUMNS = 3
PARTS = ("training", "held_out")


def lessons(entry: Entry) -> Mapping[str, Array] | None:
    """Losses (F, E) of an entry that learned in epochs, without the fit to all data; else None."""
    told = entry.model.get("provenance", {}).get("learning")
    if not told:
        return None
    parts = {key: np.asarray(told[key], dtype=float) for key in PARTS if key in told}
    return {key: value[: max(len(value) - 1, 1)] for key, value in parts.items()} or None


def learning_curves(entries: Sequence[Entry], looks: Mapping[str, Look], unit: str) -> Any:
    """Picture of all that learned in epochs, a panel for each; None where nothing did."""
    from matplotlib.lines import Line2D

    own = [(entry, told) for entry in entries if (told := lessons(entry))]
    if not own:
        return None
    columns = min(COLUMNS, len(own))
    rows = -(-len(own) // columns)
    picture = figure(0.6 + 1.8 * rows)
    axes = picture.subplots(rows, columns, squeeze=False)
    for axis in axes.flat[len(own) :]:
        axis.set_axis_off()
    for axis, (entry, told) in zip(axes.flat, own, strict=False):
        for part, losses in told.items():
            colour = looks[entry.label].colour if part == "held_out" else GREY
            epochs = np.arange(1, losses.shape[1] + 1)
            axis.plot(epochs, losses.T, color=colour, linewidth=0.6, alpha=0.6)
        if "held_out" in told:
            _ends(axis, told["held_out"])
        axis.set_yscale("log")
        axis.set_title(plain(entry.title), fontsize=7, loc="left", color=looks[entry.label].colour)
    picture.supxlabel("epoch", fontsize=8)
    picture.supylabel(f"loss {unit}", fontsize=8)
    handles = [
        Line2D([], [], color=GREY),
        Line2D([], [], color=looks[own[0][0].label].colour),
        Line2D([], [], color=DARK, marker=".", linestyle=""),
    ]
    key_above(picture, handles, ["training, each fold", "held out in the fold", "kept"])
    return picture


def _ends(axis: Any, losses: Array) -> None:
    """A dot where each fold was best."""
    for line in losses:
        known = np.where(np.isfinite(line), line, np.inf)
        best = int(known.argmin())
        if np.isfinite(known[best]):
            axis.plot(best + 1, known[best], ".", color=DARK, markersize=4, zorder=5)
