"""Rollout errors over the horizon: median and 90 % quantile of each identifier."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.report.figures.panels import plain_logarithm
from frictionid.report.figures.style import GRID, Style, figure, key_above, line, plain
from frictionid.report.sections import Model, Section, SummaryData, rollout

SHORT_DOTS = (0, (1, 1.4))


def rollout_errors(section: Section, styles: Mapping[str, Style]) -> Any:
    """Angle errors over the horizon, a panel for each data set and recipe; None without any."""
    horizons, description = section.fitted.horizons, section.description
    if not horizons:
        return None
    rows = [[(data, recipe) for recipe in section.recipes] for data in section.data]
    if len(section.recipes) == 1 and len(rows) <= 3:
        rows = [[panel for row in rows for panel in row]]
    picture = figure(0.75 + 2.1 * len(rows))
    axes = picture.subplots(len(rows), len(rows[0]), sharex=True, sharey=True, squeeze=False)
    for row, axes_of_row in zip(rows, axes, strict=True):
        for (data, recipe), axis in zip(row, axes_of_row, strict=True):
            for model in section.under(recipe):
                _errors(axis, data, model, styles[model.label])
            axis.set_title(_title(section, data, recipe), fontsize=7.5)
            axis.grid(**GRID)
        axes_of_row[0].set_ylabel(f"{description.coordinate} error [{description.angle_unit}]")
    _scales(axes[0, 0], horizons)
    picture.supxlabel("horizon [s]", fontsize=8)
    labels = dict.fromkeys(model.label for model in section.models)
    key = {name: line(styles[name].colour, styles[name].line) for name in labels}
    median = line("black")
    median.set(marker="o", markersize=2.8)
    quantile = line("black", SHORT_DOTS, 0.8)
    key_above(picture, {**key, "median": median, "90 % quantile": quantile})
    return picture


def _title(section: Section, data: SummaryData, recipe: str) -> str:
    parts = [plain(data.dataset), "held out" if data.held_out else "never seen"]
    return ", ".join([*parts, f"{plain(recipe)} recipe"] if len(section.recipes) > 1 else parts)


def _errors(axis: Any, data: SummaryData, model: Model, style: Style) -> None:
    """Errors of a model that was scored there; arrows at the upper edge where one is infinite."""
    horizons = np.asarray(data.horizons)
    for statistic, width, alpha, dot in (("median", 1.3, 1.0, "o"), ("q90", 0.8, 0.75, "")):
        values = np.array([data.value(model, rollout(h, statistic)) for h in horizons])
        drawn = {"color": style.colour, "linewidth": width, "alpha": alpha, "marker": dot}
        drawn["linestyle"] = style.line if statistic == "median" else SHORT_DOTS
        shown = np.where(np.isfinite(values) & (values > 0), values, np.nan)
        axis.plot(horizons, shown, markersize=2.8, **drawn)
        infinite = horizons[np.isposinf(values)]
        if len(infinite):
            upper = axis.get_xaxis_transform()
            arrows = {"color": style.colour, "markersize": 5, "transform": upper, "clip_on": False}
            axis.plot(infinite, np.ones(len(infinite)), "^", **arrows)


def _scales(axis: Any, horizons: tuple[float, ...]) -> None:
    """Logarithmic axes, which all panels share, with plain numbers."""
    from matplotlib.ticker import NullLocator

    axis.set_xscale("log")
    axis.set_xticks(horizons, [f"{h:g}" for h in horizons])
    axis.xaxis.set_minor_locator(NullLocator())
    plain_logarithm(axis)
