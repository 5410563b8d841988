"""Rollout errors over the horizon: median and 90 % quantile of each identifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import Look, figure, key_above, plain
from frictionid.report.load import Entry, Key, Section
from frictionid.report.numbers import coordinate


def rollout_errors(
    section: Section, horizons: Sequence[float], looks: Mapping[str, Look], unit: str
) -> Any:
    """Angle errors over the horizon, a panel for each data set and recipe; None without any."""
    if not horizons:
        return None
    rows = _panels(section)
    picture = figure(0.75 + 2.1 * len(rows))
    axes = picture.subplots(len(rows), len(rows[0]), sharex=True, sharey=True, squeeze=False)
    for row, line in zip(rows, axes, strict=True):
        for (dataset, recipe), axis in zip(row, line, strict=True):
            for entry in section.under(recipe):
                if dataset in entry.scores:
                    _error(axis, entry, dataset, horizons, looks[entry.label])
            axis.set_title(_title(section, dataset, recipe), fontsize=7.5)
            axis.grid(color="#EEEEEE", linewidth=0.6)
        line[0].set_ylabel(f"{coordinate(unit)} error [{unit}]")
    _scales(axes[0, 0], horizons)
    picture.supxlabel("horizon [s]", fontsize=8)
    _key(picture, section, looks)
    return picture


def _panels(section: Section) -> list[list[tuple[str, str]]]:
    """Data set and recipe of each panel: a row for each data set, or all in one for one recipe."""
    datasets = (section.dataset, *section.tests)
    rows = [[(dataset, recipe) for recipe in section.recipes] for dataset in datasets]
    if len(section.recipes) == 1 and len(datasets) <= 3:
        rows = [[panel for row in rows for panel in row]]
    return rows


def _title(section: Section, dataset: str, recipe: str) -> str:
    words = [plain(dataset), "held out" if dataset == section.dataset else "never seen"]
    return ", ".join([*words, f"{plain(recipe)} recipe"] if len(section.recipes) > 1 else words)


def _error(axis: Any, entry: Entry, dataset: str, horizons: Sequence[float], look: Look) -> None:
    for statistic, width, alpha, marker in (("median", 1.3, 1.0, "o"), ("q90", 0.8, 0.75, "")):
        keys = [Key("rollout_angle", statistic, h) for h in horizons]
        values = np.array([entry.scores[dataset][key] for key in keys])
        style = look.line if statistic == "median" else (0, (1, 1.4))
        axis.plot(
            horizons,
            np.where(np.isfinite(values) & (values > 0), values, np.nan),
            color=look.colour,
            linestyle=style,
            linewidth=width,
            alpha=alpha,
            marker=marker,
            markersize=2.8,
        )
        _infinite(axis, np.asarray(horizons)[np.isposinf(values)], look)


def _infinite(axis: Any, horizons: Array, look: Look) -> None:
    """Arrows at the upper edge where an error is infinite."""
    if len(horizons):
        axis.plot(
            horizons,
            np.ones(len(horizons)),
            "^",
            color=look.colour,
            markersize=5,
            transform=axis.get_xaxis_transform(),
            clip_on=False,
        )


def _scales(axis: Any, horizons: Sequence[float]) -> None:
    """Logarithmic axes, which all panels share, with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xticks(horizons, [f"{h:g}" for h in horizons])
    axis.xaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.yaxis.set_minor_formatter(NullFormatter())


def _key(picture: Any, section: Section, looks: Mapping[str, Look]) -> None:
    from matplotlib.lines import Line2D

    labels = list(dict.fromkeys(entry.label for entry in section.entries))
    handles = [Line2D([], [], color=looks[n].colour, linestyle=looks[n].line) for n in labels]
    handles += [
        Line2D([], [], color="black", marker="o", markersize=2.8),
        Line2D([], [], color="black", linestyle=(0, (1, 1.4)), linewidth=0.8),
    ]
    key_above(picture, handles, [*labels, "median", "90 % quantile"])
