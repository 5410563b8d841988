"""Scores of the models: boxes, error over the horizon, over complexity and over the loss."""

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from frictionid.arrays import Array

from ..numbers import INFINITE, short
from ..sections import EULER, Model, Section, SummaryData, rollout
from ..summary_table import ONE_STEP
from ..verdict import Candidate, Verdict, verdict_of
from .style import (
    DARK,
    DASHED,
    GREY,
    HALF_PAGE,
    Style,
    Styles,
    figure,
    key_above,
    line,
    marker,
    mixed,
    plain,
    plain_logarithm,
)

TRUTH = {"color": DARK, "linewidth": 1, "linestyle": DASHED, "zorder": 1}


def one_step_boxes(section: Section, styles: Styles) -> Any:
    """Losses of the held-out folds: a box for each identifier and recipe, a panel for each loss."""
    heights = _heights(section.of_role("none", "fitted", "given"))
    lowest = max(heights.values(), default=0.0)
    picture = figure(0.99 + 0.24 * lowest)
    axes = picture.subplots(1, len(ONE_STEP), sharey=True, squeeze=False)[0]
    for axis, (column, name) in zip(axes, ONE_STEP.items(), strict=True):
        for model, height in heights.items():
            losses, colour = section.fitted.of_folds(model, column), styles[model.label].colour
            _box(axis, losses, height, colour, _is_hollow(section, model.recipe))
        _truth(axis, section, column)
        scheme, statistic = name.split()
        unit = section.description.angle_unit
        axis.set_xlabel(f"one-step loss, {scheme} ({statistic}) [{unit}/s]")
        axis.grid(axis="x")
        axis.tick_params(axis="y", length=0)
    axes[0].set_yticks(list(heights.values()), [plain(model.name) for model in heights])
    axes[0].set_ylim(lowest + 0.7, -0.7)
    return picture


def _heights(models: Sequence[Model]) -> dict[Model, float]:
    """Height of each box: recipes of an identifier side by side, a gap between identifiers."""
    labels = list(dict.fromkeys(model.label for model in models))
    ordered = sorted(models, key=lambda model: labels.index(model.label))
    out, at = {}, 0.0
    for _, recipes in groupby(ordered, key=lambda model: model.label):
        for model in recipes:
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
    face = "white" if hollow else mixed(colour, 0.7)
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


def _truth(axis: Any, section: Section, column: str) -> None:
    for model in section.of_role("truth"):
        losses = section.fitted.of_folds(model, column)
        if len(losses) and np.isfinite(losses).all():
            mean = float(losses.mean())
            axis.axvline(mean, **TRUTH)
            place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
            above = {"xytext": (0, 1), "textcoords": "offset points", "fontsize": 7}
            axis.annotate(f"truth {short(mean, 3)}", (mean, 1), **place, **above, color=DARK)


SHORT_DOTS = (0, (1, 1.4))


def rollout_errors(section: Section, styles: Styles) -> Any:
    """Angle errors over the horizon, a panel for each data set and recipe; None without any."""
    from matplotlib.ticker import NullLocator

    horizons, description = section.fitted.horizons, section.description
    if not horizons:
        return None
    panels = [(data, recipe) for data in section.data for recipe in section.recipes]
    abreast = len(section.recipes)
    if abreast == 1 and len(panels) <= 3:
        abreast = len(panels)
    rows = len(panels) // abreast
    picture = figure(0.75 + 2.1 * rows)
    axes = picture.subplots(rows, abreast, sharex=True, sharey=True, squeeze=False)
    for (data, recipe), axis in zip(panels, axes.flat, strict=True):
        for model in section.under(recipe):
            _errors(axis, data, model, styles[model.label])
        words = [plain(data.dataset), data.novelty]
        words += [f"{plain(recipe)} recipe"] if len(section.recipes) > 1 else []
        axis.set_title(", ".join(words), fontsize=7.5)
        axis.grid()
    for axis in axes[:, 0]:
        axis.set_ylabel(f"{description.coordinate} error [{description.angle_unit}]")
    axis = axes[0, 0]  # all share its scales
    axis.set_xscale("log")
    axis.set_xticks(horizons, [f"{h:g}" for h in horizons])
    axis.xaxis.set_minor_locator(NullLocator())
    plain_logarithm(axis)
    picture.supxlabel("horizon [s]")
    labels = dict.fromkeys(model.label for model in section.models)
    median = line("black")
    median.set(marker="o", markersize=2.8)
    key = {name: line(styles[name].colour, styles[name].line) for name in labels}
    key |= {"median": median, "90 % quantile": line("black", SHORT_DOTS, 0.8)}
    key_above(picture, key)
    return picture


def _errors(axis: Any, data: SummaryData, model: Model, style: Style) -> None:
    """Errors of a model that was scored there; arrows at the upper edge where one is infinite."""
    horizons = np.asarray(data.horizons)
    median = {"linewidth": 1.3, "marker": "o", "linestyle": style.line}
    quantile = {"linewidth": 0.8, "alpha": 0.75, "marker": "", "linestyle": SHORT_DOTS}
    for statistic, drawn in (("median", median), ("q90", quantile)):
        values = np.array([data.value(model, rollout(h, statistic)) for h in horizons])
        shown = np.where(np.isfinite(values) & (values > 0), values, np.nan)
        axis.plot(horizons, shown, color=style.colour, markersize=2.8, **drawn)
        infinite = horizons[np.isposinf(values)]
        if len(infinite):
            upper = axis.get_xaxis_transform()
            arrows = {"color": style.colour, "markersize": 5, "transform": upper, "clip_on": False}
            axis.plot(infinite, np.ones(len(infinite)), "^", **arrows)


MARKERS = {"none": "s", "given": "D", "truth": "*"}  # others have those of their recipes
SIZES = {"none": 6, "truth": 9}
RECIPES = ("o", "^", "v", "P", "X", "<", ">", "p")


def loss_against(section: Section, styles: Styles) -> Any:
    """Rollout and curve error over one-step loss, a point for each model; None without truth."""
    data, description = section.fitted, section.description
    if description.truth is None or not data.horizons:
        return None
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
            loss, colour = data.value(model, EULER), styles[model.label].colour
            height = heights.get(model, float("nan"))
            if model.role == "truth" and np.isfinite(loss):
                axis.axvline(loss, **TRUTH)
            if not np.isfinite([loss, height]).all() or height <= 0:
                continue
            kind = MARKERS.get(model.role) or _marker(section, model.recipe)
            face = "white" if _is_hollow(section, model.recipe) else colour
            # points on the same spot become rings around each other
            size = SIZES.get(model.role, max(10 - 1.5 * names.index(model.label), 4.0))
            look = {"markersize": size, "markeredgewidth": 1.3}
            axis.plot(loss, height, kind, color=colour, markerfacecolor=face, **look)
        axis.set(xlabel=f"one-step loss, euler [{unit}/s]", ylabel=label)
        axis.grid()
        plain_logarithm(axis)
    roles = {model.label: MARKERS.get(model.role, "o") for model in section.models}
    key = {name: marker(styles[name].colour, kind, 5) for name, kind in roles.items()}
    for recipe in section.recipes if len(section.recipes) > 1 else ():
        face = "white" if _is_hollow(section, recipe) else "black"
        key[f"{recipe} recipe"] = marker("black", _marker(section, recipe), 6, face)
    key_above(picture, key, 0.8)
    return picture


def _marker(section: Section, recipe: str) -> str:
    """Each recipe has its own, the first two are dots."""
    place = section.recipes.index(recipe) if recipe in section.recipes else 0
    return RECIPES[max(place - 1, 0) % len(RECIPES)]


def _is_hollow(section: Section, recipe: str) -> bool:
    return len(section.recipes) > 1 and recipe == section.recipes[0]


# --- Beside a verdict -----------------------------------------------------------------------------


def errors_of_models(section: Section, styles: Styles) -> Any:
    """Error of every model, a line each, a dot for each fold, grouped by recipe; None of fewer.

    The bar is the error of all predictions, as in the tables.
    """
    verdict = verdict_of(section)
    shown = [c for c in verdict.candidates if np.isfinite(c.error) and c.error > 0]
    if len(shown) < 2:
        return None
    order = ["", *section.recipes]
    shown.sort(key=lambda c: (order.index(c.model.recipe), c.error))
    picture = figure(0.9 + 0.19 * (len(shown) + len(order)), HALF_PAGE)
    axis, height, names = picture.subplots(), 0.0, {}
    for recipe, members in groupby(shown, key=lambda c: c.model.recipe):
        if recipe and len(section.recipes) > 1:
            place = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 7.5}
            axis.annotate(f"recipe {plain(recipe)}", (0.01, height), **place, color=GREY)
            height += 0.9
        for candidate in members:
            _candidate_errors(
                axis, candidate, height, styles[candidate.model.label].colour, verdict
            )
            names[height] = plain(candidate.model.label)
            height += 1.0
        height += 0.3
    axis.set_yticks(list(names), list(names.values()))
    axis.set_ylim(height - 0.3, -0.8)
    values = verdict.measure.shown(np.concatenate([[c.error, *c.by_fold] for c in shown]))
    values = values[np.isfinite(values) & (values > 0)]
    plain_logarithm(axis, "x")
    axis.set_xlim(0.85 * values.min(), 1.15 * values.max())
    axis.grid(axis="x")
    axis.tick_params(axis="y", length=0)
    axis.set_xlabel(f"{verdict.measure.of_what}, held out")
    key = {"median of all predictions": marker(DARK, "|", 8), "a fold": marker(GREY, "o", 3)}
    if verdict.provisional:
        word = "recommended" if verdict.recommended else "until then"
        key[word] = marker(DARK, "*", 8)
    if any(c.unfit for c in shown):
        key["not plausible, or not converged"] = marker(GREY, "o", 4, "white")
    key_above(picture, key, 0.8)
    return picture


def _candidate_errors(
    axis: Any, candidate: Candidate, height: float, colour: str, verdict: Verdict
) -> None:
    """A model's folds as dots, hollow where it cannot be recommended, and its error as a bar."""
    error, *folds = verdict.measure.shown(np.append(candidate.error, candidate.by_fold))
    folds = [e for e in folds if np.isfinite(e)]
    face = "white" if candidate.unfit else mixed(colour, 0.45)
    dots = {"markersize": 3.4, "markeredgewidth": 0.7, "markerfacecolor": face}
    axis.plot(folds, np.full(len(folds), height), "o", color=colour, zorder=3, **dots)
    axis.plot(error, height, "|", color=colour, markersize=11, markeredgewidth=2.2)
    name = candidate.name == verdict.provisional
    if name:
        axis.plot(error, height, "*", color=DARK, markersize=8, zorder=4)
    text, place = short(error), {"xycoords": ("axes fraction", "data"), "va": "center"}
    weight = "bold" if name else "normal"
    axis.annotate(text, (1.01, height), **place, fontsize=7, weight=weight)
