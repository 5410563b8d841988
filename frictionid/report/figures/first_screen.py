"""The two pictures beside a verdict: friction of the joints, and the error of every model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ..numbers import short
from ..recommended import chosen_of
from ..sections import DataDescription, Model, Section
from ..verdict import Candidate, Verdict, verdict_of
from .curves import curve_and_band
from .motion import MEASURED
from .style import (
    DARK,
    DASHED,
    GREY,
    Style,
    draw_truth,
    figure,
    frame,
    key_above,
    line,
    marker,
    measured,
    mixed,
    most,
    panels,
    patch,
    plain,
    plain_logarithm,
    unmeasured_key,
)

WIDTH = 5.6  # [inch], half a page of the screen
ABREAST = 4  # joints at most
BAND = 0.25  # opacity
WIDEST = 2.5  # a rival's curve may be so many times as high as the model's with its band
RIVAL: Mapping[str, Any] = {"color": "#B5B5B5", "linewidth": 0.7}


def friction_of_the_choice(section: Section, styles: Mapping[str, Style]) -> Any:
    """Friction over velocity, a panel for each joint: the model that the verdict names, and rivals.

    With its 95 % band, by shooting or by what leaving out each fold changes. Rivals are the fits by
    its recipe and by that of the verdict. None where no model has a friction curve.
    """
    verdict, data = verdict_of(section), section.description
    chosen = chosen_of(section, verdict)
    if chosen is None or not np.isfinite(chosen.curves[-1]).any():
        return None
    recipes = {chosen.recipe, verdict.recipe}
    rivals = [m for m in section.of_role("fitted") if m.recipe in recipes and m is not chosen]
    joints, colour = len(data.joints), styles[chosen.label].colour
    columns = joints if joints <= 3 else min(-(-joints // 2), ABREAST)
    rows = -(-joints // columns)
    picture = figure(0.7 + (2.3 if rows == 1 else 1.6) * rows, WIDTH)
    axes = picture.subplots(rows, columns, squeeze=False).ravel()
    for joint, axis in enumerate(axes[:joints]):
        _friction(axis, chosen, rivals, data, joint, colour)
        axis.set_title(plain(data.joints[joint]))
        axis.locator_params(axis="x", nbins=3 if columns == ABREAST else 5)
        if joint % columns == 0:
            axis.set_ylabel(f"friction [{data.torque_units[joint]}]")
    for spare in axes[joints:]:
        spare.set_axis_off()
    key = {chosen.name: line(colour, linewidth=1.8)}
    if np.isfinite(curve_and_band(chosen, data, 0)[2]).any():
        key["its 95 % band"] = patch(colour, BAND)
    if rivals:
        key["other models"] = line(**RIVAL)
    if data.truth is not None:
        key["truth"] = line(DARK, DASHED, 1)
    key_above(picture, key | unmeasured_key(data))
    picture.supxlabel(f"velocity [{data.velocity_unit}]")
    return picture


def _friction(
    axis: Any,
    chosen: Model,
    rivals: Sequence[Model],
    data: DataDescription,
    joint: int,
    colour: str,
) -> None:
    """A joint's panel, as high as the model's band where the joint moved, and the truth."""
    w, x, curve, half = data.velocity[:, joint], *curve_and_band(chosen, data, joint)
    inside = measured(x, data, joint)
    heights = [(np.abs(curve) + np.nan_to_num(half))[inside]]
    heights += [] if data.truth is None else [np.abs(data.truth[:, joint])]
    high = max(float(np.max(h, initial=0.0)) for h in heights)
    others = [m.curves[-1][:, joint] for m in rivals]
    if others:
        high = max(high, min(most([np.abs(c) for c in others]), WIDEST * high))
    high = 1.08 * high or 1.0
    frame(axis, w, data, joint, high)
    for other in others:
        axis.plot(w, other, **RIVAL)
    axis.fill_between(x, curve - half, curve + half, color=colour, alpha=BAND, linewidth=0)
    axis.plot(x, curve, color=colour, linewidth=1.8)
    draw_truth(axis, data, joint)


def errors_of_models(section: Section, styles: Mapping[str, Style]) -> Any:
    """Error of every model, a line each, a dot for each fold, grouped by recipe; None of fewer.

    The bar is the error of all predictions, as in the tables.
    """
    verdict = verdict_of(section)
    shown = [c for c in verdict.candidates if np.isfinite(c.error) and c.error > 0]
    if len(shown) < 2:
        return None
    order = ["", *section.recipes]
    shown.sort(key=lambda c: (order.index(c.model.recipe), c.error))
    picture = figure(0.9 + 0.19 * (len(shown) + len(order)), WIDTH)
    axis, height, names = picture.subplots(), 0.0, {}
    for recipe, members in groupby(shown, key=lambda c: c.model.recipe):
        if recipe and len(section.recipes) > 1:
            place = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 7.5}
            axis.annotate(f"recipe {plain(recipe)}", (0.01, height), **place, color=GREY)
            height += 0.9
        for candidate in members:
            _errors(axis, candidate, height, styles[candidate.model.label].colour, verdict)
            names[height] = plain(candidate.model.label)
            height += 1.0
        height += 0.3
    axis.set_yticks(list(names), list(names.values()))
    axis.set_ylim(height - 0.3, -0.8)
    _scale(axis, shown)
    axis.set_xlabel(f"{verdict.measure.of_what}, held out")
    key = {"median of all predictions": marker(DARK, "|", 8), "a fold": marker(GREY, "o", 3)}
    if verdict.provisional:
        word = "recommended" if verdict.recommended else "until then"
        key[word] = marker(DARK, "*", 8)
    if any(c.unfit for c in shown):
        key["not plausible, or not converged"] = marker(GREY, "o", 4, "white")
    key_above(picture, key, 0.8)
    return picture


def _errors(axis: Any, candidate: Candidate, height: float, colour: str, verdict: Verdict) -> None:
    """A model's folds as dots, hollow where it cannot be recommended, and its error as a bar."""
    folds = candidate.by_fold[np.isfinite(candidate.by_fold)]
    face = "white" if candidate.unfit else mixed(colour, 0.45)
    dots = {"markersize": 3.4, "markeredgewidth": 0.7, "markerfacecolor": face}
    axis.plot(folds, np.full(len(folds), height), "o", color=colour, zorder=3, **dots)
    axis.plot(candidate.error, height, "|", color=colour, markersize=11, markeredgewidth=2.2)
    name = candidate.name == verdict.provisional
    if name:
        axis.plot(candidate.error, height, "*", color=DARK, markersize=8, zorder=4)
    text, place = short(candidate.error), {"xycoords": ("axes fraction", "data"), "va": "center"}
    weight = "bold" if name else "normal"
    axis.annotate(text, (1.01, height), **place, fontsize=7, weight=weight)


def _scale(axis: Any, shown: Sequence[Candidate]) -> None:
    """A logarithmic axis of errors with plain numbers."""
    values = np.concatenate([[c.error, *c.by_fold] for c in shown])
    values = values[np.isfinite(values) & (values > 0)]
    plain_logarithm(axis, "x")
    axis.set_xlim(0.85 * values.min(), 1.15 * values.max())
    axis.grid(axis="x")
    axis.tick_params(axis="y", length=0)


def torque_over_time(section: Section, styles: Mapping[str, Style]) -> Any:
    """Measured torque of each joint over time, and that of the model that the verdict names.

    What lies between rigid bodies alone and the whole model is friction. None without torques.
    """
    chosen, data = chosen_of(section, verdict_of(section)), section.description
    if chosen is None or not chosen.torque:
        return None
    time, *parts = (chosen.torque[key] for key in ("time", "measured", "model", "rigid"))
    colour = styles[chosen.label].colour
    looks: dict[str, dict[str, Any]] = {
        "measured": {"color": MEASURED, "linewidth": 3.5},
        "rigid bodies and friction": {"color": colour, "linewidth": 1.1},
        "rigid bodies alone": {"color": DARK, "linewidth": 0.8, "linestyle": DASHED},
    }

    def draw(axis: Any, joint: int, _column: int) -> None:
        for values, look in zip(parts, looks.values(), strict=True):
            axis.plot(time, values[:, joint], **look)
        axis.margins(x=0)
        axis.grid()
        place: dict[str, Any] = {"xycoords": "axes fraction", "va": "center"}
        axis.annotate(plain(data.joints[joint]), (1.01, 0.5), **place, fontsize=7)

    labels = [f"[{unit}]" for unit in data.torque_units][: parts[0].shape[1]]
    key = {name: line(**look) for name, look in looks.items()}
    below = f"time [s], {plain(chosen.torque['recording'])}"
    return panels(draw, labels, [""], key, below, 0.75, WIDTH, sharex=True)
