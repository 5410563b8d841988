"""Box plots of the one-step losses over the folds, with the truth's own score as a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import DARK, DASHED, GRID, Style, figure, plain
from frictionid.report.numbers import INFINITE, short
from frictionid.report.sections import Model, Section
from frictionid.report.summary_table import ONE_STEP


def one_step_boxes(section: Section, styles: Mapping[str, Style]) -> Any:
    """Losses of the held-out folds: a box for each identifier and recipe, a panel for each loss."""
    models = section.of_role("none", "fitted", "given")
    heights, several = _heights(models), len(section.recipes) > 1
    picture = figure(0.75 + 0.24 * max(heights.values(), default=0.0) + 0.24)
    axes = picture.subplots(1, len(ONE_STEP), sharey=True, squeeze=False)[0]
    for axis, (column, name) in zip(axes, ONE_STEP.items(), strict=True):
        for model, height in heights.items():
            hollow = several and model.recipe == section.recipes[0]
            losses = section.fitted.of_folds(model, column)
            _box(axis, losses, height, styles[model.label].colour, hollow)
        _truth(axis, section, column)
        scheme, statistic = name.split()
        unit = section.description.angle_unit
        axis.set_xlabel(f"one-step loss, {scheme} ({statistic}) [{unit}/s]")
        axis.grid(axis="x", **GRID)
        axis.set_axisbelow(True)
        axis.tick_params(axis="y", length=0)
    axes[0].set_yticks(list(heights.values()), [plain(model.name) for model in heights])
    axes[0].set_ylim(max(heights.values(), default=0.0) + 0.7, -0.7)
    return picture


def _heights(models: Sequence[Model]) -> dict[Model, float]:
    """Height of each box: recipes of an identifier side by side, a gap between identifiers."""
    labels = list(dict.fromkeys(model.label for model in models))
    ordered = sorted(models, key=lambda model: labels.index(model.label))
    out, at = {}, 0.0
    for _, own in groupby(ordered, key=lambda model: model.label):
        for model in own:
            out[model] = at
            at += 0.8
        at += 0.45
    return out


def _box(axis: Any, losses: Array, height: float, colour: str, hollow: bool) -> None:
    """Quartiles, range and mean of a box, and the folds as dots; `hollow` tells recipes apart."""
    finite = losses[np.isfinite(losses)]
    lost = len(losses) - len(finite)
    if lost:
        text, place = f"{INFINITE} in {lost} of {len(losses)} folds ", ("axes fraction", "data")
        axis.annotate(text, (1, height), xycoords=place, ha="right", va="center")
    if not len(finite):
        return
    edge = {"color": colour, "linewidth": 0.9}
    face = "white" if hollow else _tint(colour, 0.3)
    axis.boxplot(
        [finite],
        positions=[height],
        orientation="horizontal",
        widths=0.56,
        whis=(0, 100),
        manage_ticks=False,
        patch_artist=True,
        boxprops={"facecolor": face, "edgecolor": colour, "linewidth": 0.9},
        medianprops={"color": colour, "linewidth": 1.8},
        whiskerprops=edge,
        capprops=edge,
    )
    dots = height + 0.16 * np.where(np.arange(len(finite)) % 2, 1, -1)
    axis.plot(finite, dots, "o", markersize=1.8, color=colour, alpha=0.7, markeredgewidth=0)
    mean = {"color": "white", "markeredgecolor": DARK, "zorder": 4}
    axis.plot([finite.mean()], [height], "D", markersize=3, **mean)


def _tint(colour: str, strength: float) -> Any:
    from matplotlib.colors import to_rgb

    return tuple(1 - strength * (1 - part) for part in to_rgb(colour))


def _truth(axis: Any, section: Section, column: str) -> None:
    for model in section.of_role("truth"):
        losses = section.fitted.of_folds(model, column)
        if not len(losses) or not np.isfinite(losses).all():
            continue
        mean = float(losses.mean())
        axis.axvline(mean, color=DARK, linewidth=1, linestyle=DASHED, zorder=1)
        axis.annotate(
            f"truth {short(mean, 3)}",
            (mean, 1),
            xycoords=("data", "axes fraction"),
            xytext=(0, 1),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=7,
            color=DARK,
        )
