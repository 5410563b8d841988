"""Learning curves, the progress of tuning, and the sensitivity to each cause."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.comparison.search_space import Objective
from frictionid.comparison.tuning import Study, by_task

from ..sections import Model, Section
from .style import (
    COLOURS,
    DARK,
    DASHED,
    GREY,
    Styles,
    figure,
    key_above,
    line,
    marker,
    panel_grid,
    patch,
    plain,
    plain_logarithm,
)


def progress(studies: Sequence[Study], objective: Objective) -> Any:
    """The picture of all studies: on all data thick, in each training fold thin."""
    tasks = by_task(studies)
    picture, axes = panel_grid(len(tasks), ABREAST, 1.9, 0.6)
    samplers = list(dict.fromkeys(study.sampler for study in studies))
    colours = dict(zip(samplers, COLOURS, strict=False))
    thick = {"linewidth": 1.5, "alpha": 1.0, "zorder": 3}
    thin = {"linewidth": 0.5, "alpha": 0.4, "zorder": 2}
    for axis, tuned in zip(axes, tasks, strict=True):
        for study in tuned:
            values = np.array([trial.value for trial in study.trials])
            lowest = np.minimum.accumulate(np.where(np.isnan(values), np.inf, values))
            trials = np.arange(1, len(values) + 1)
            style = thick if study.fold is None else thin
            axis.step(trials, lowest, where="post", color=colours[study.sampler], **style)
        axis.set_title(plain(tuned[0].task.title), fontsize=7, loc="left")
        axis.locator_params(axis="x", integer=True, nbins=6)
    unit = "rad" if objective.horizon is not None else "rad/s"
    picture.supxlabel("trials")
    picture.supylabel(f"{objective.words} [{unit}]")
    key_above(picture, {name: line(colour) for name, colour in colours.items()})
    return picture


PARTS = ("training", "held_out")


def losses_of(model: Model) -> Mapping[str, Array] | None:
    """Losses (F, E) of a model that learned in epochs, without the fit to all data; else None."""
    learning = model.provenance.learning
    parts = {key: learning[key] for key in PARTS if key in learning}
    return {key: value[: max(len(value) - 1, 1)] for key, value in parts.items()} or None


def learning_curves(section: Section, styles: Styles) -> Any:
    """Picture of all that learned in epochs, a panel for each; None where nothing did."""
    models = section.of_role("fitted")
    shown = [(model, losses) for model in models if (losses := losses_of(model))]
    if not shown:
        return None
    picture, axes = panel_grid(len(shown), ABREAST, 1.8, 0.6)
    for axis, (model, losses) in zip(axes, shown, strict=True):
        colours = {"training": GREY, "held_out": styles[model.label].colour}
        for part, values in losses.items():
            epochs = np.arange(1, values.shape[1] + 1)
            axis.plot(epochs, values.T, color=colours[part], linewidth=0.6, alpha=0.6)
        for values in losses.get("held_out", ()):
            finite = np.where(np.isfinite(values), values, np.inf)
            best = int(finite.argmin())
            if np.isfinite(finite[best]):
                axis.plot(best + 1, finite[best], ".", color=DARK, markersize=4, zorder=5)
        plain_logarithm(axis)
        axis.xaxis.get_major_locator().set_params(integer=True)
        axis.set_title(plain(model.name), fontsize=7, loc="left", color=colours["held_out"])
    picture.supxlabel("epoch")
    picture.supylabel("loss without friction = 1")
    key = {
        "training, each fold": line(GREY),
        "held out in the fold": line(styles[shown[0][0].label].colour),
        "kept": marker(DARK, "."),
    }
    key_above(picture, key)
    return picture


SHOWN = 14  # bars of a panel
ABREAST = 3


# What a panel shows: its column of the study's `summarised` frame, and its axis label.
CHANGE = ("curve_change", "change of the friction curve [%]")
ERROR = ("curve_error", "error of the friction curve [%]")
ROLLOUT = ("rollout_ratio", "rollout error over that as recorded")
LOSS = ("loss_change", "change of the one-step loss [%]")


def summarised(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame of a study with per cent: the worst joint's curve, and changes to the nominal fit.

    Adds `curve_change`, `curve_error` and `loss_change` [%], and `rollout_ratio` [1].
    """
    out = frame.copy()
    for key in ("curve_change", "curve_error"):
        out[key] = 100.0 * frame.filter(regex=rf"^{key}_\d+$").max(axis=1)
    groups = ["dataset", "identifier", "recipe"]
    for key in ("rollout", "loss"):
        nominal = frame[key].where(frame.cause == "nominal")
        reference = nominal.groupby([frame[g] for g in groups]).transform("max")
        out[f"{key}_ratio"] = frame[key] / reference
    out["loss_change"] = 100.0 * (out.pop("loss_ratio") - 1.0)
    return out


def is_known(frame: pd.DataFrame) -> bool:
    """Whether true curves are known of a summarised frame."""
    return bool(np.isfinite(frame.curve_error).any())


def tornado(frame: pd.DataFrame) -> Any:
    """Bars of each cause, the largest effect first: a row for each recipe, a column per measure.

    frame : summarised, of one data set and identifier
    """
    shown, recipes = (CHANGE, ROLLOUT, LOSS), list(dict.fromkeys(frame.recipe))
    order = _by_effect(frame, CHANGE[0])
    picture = figure(0.6 + len(recipes) * (0.55 + 0.17 * len(order)))
    axes = picture.subplots(len(recipes), len(shown), squeeze=False, sharex="col")
    for row, recipe in zip(axes, recipes, strict=True):
        for axis, (column, _) in zip(row, shown, strict=True):
            _bars(axis, frame[frame.recipe == recipe], order, column)
            axis.tick_params(labelleft=axis is row[0])
        row[0].set_title(plain(recipe), loc="left", weight="bold")
    for axis, (_, label) in zip(axes[-1], shown, strict=True):
        axis.set_xlabel(label)
    key = {
        "too small, early": patch(COLOURS[0]),
        "too large, late, noisier, fewer": patch(COLOURS[1]),
        "as recorded": line(GREY, DASHED),
    }
    key_above(picture, key)
    return picture


def _by_effect(frame: pd.DataFrame, column: str) -> list[str]:
    """Names of the causes, the largest value in any recipe first."""
    changed = frame[frame.cause != "nominal"]
    largest = changed.groupby("name", sort=False)[column].max()
    return list(largest.sort_values(ascending=False, kind="stable").index[:SHOWN])


def _bars(axis: Any, frame: pd.DataFrame, order: Sequence[str], column: str) -> None:
    for place, name in enumerate(order):
        bars = frame[frame.name == name].sort_values("amount")
        height = 0.8 / max(len(bars), 1)
        places = place - 0.4 + (np.arange(len(bars)) + 0.5) * height
        colours = np.where(bars.amount < 0, *COLOURS[:2])
        axis.barh(places, bars[column], 0.9 * height, color=colours)
    nominal = float(frame.loc[frame.cause == "nominal", column].iloc[0])
    axis.axvline(nominal, color=GREY, linestyle=DASHED, linewidth=0.8)
    axis.axvline(0.0, color="#BBBBBB", linewidth=0.5)
    axis.set_yticks(range(len(order)), [plain(name) for name in order])
    axis.set_ylim(len(order) - 0.5, -0.5)
    axis.locator_params(axis="x", nbins=5)


def over_amounts(frame: pd.DataFrame) -> Any:
    """The curve's error, or change, over the amount of each cause: a line for each recipe.

    None where no cause has two amounts.

    frame : summarised, of one data set and identifier
    """
    column, label = ERROR if is_known(frame) else CHANGE
    recipes = dict(zip(dict.fromkeys(frame.recipe), COLOURS, strict=False))
    order = _by_effect(frame, column)
    names = [name for name in order if (frame.name == name).sum() > len(recipes)]
    if not names:
        return None
    picture, axes = panel_grid(len(names), ABREAST, 1.6, 0.6)
    nominal = frame[frame.cause == "nominal"].set_index("recipe")
    largest = max(float(frame.loc[np.isfinite(frame[column]), column].max()), 1e-6)
    for axis, name in zip(axes, names, strict=True):
        rows = frame[frame.name == name]
        cause = rows.cause.iloc[0]
        for recipe, colour in recipes.items():
            shown = rows[rows.recipe == recipe]
            whole = (1.0 if cause in ("rate", "recordings") else 0.0, nominal.loc[recipe, column])
            points = sorted([*zip(shown.amount, shown[column], strict=True), whole])
            axis.plot(*zip(*points, strict=True), "o-", color=colour, markersize=2.5)
        axis.set_title(f"{plain(name)}: {_AXES[cause]}", fontsize=7, loc="left")
        axis.set_ylim(0.0, 1.1 * largest)
    picture.supylabel(label)
    key_above(picture, {recipe: line(colour) for recipe, colour in recipes.items()})
    return picture


_AXES = {
    "parameter": "relative error",
    "gain": "relative error",
    "delay": "late by [s]",
    "tilt": "[deg]",
    "noise": "added [deg]",
    "rate": "one sample of",
    "recordings": "share of the recordings",
}
