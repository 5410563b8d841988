"""Friction curves: all folds and their mean, the truth, and how often each speed occurred.

Where friction is the mean of an ensemble, a band shows how far its members differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.ensembles import OPACITY, spread
from frictionid.report.figures.style import DARK, GREY, PALE, Look, figure, key_above, plain
from frictionid.report.load import Entry, Section

COLUMNS = 4  # identifiers side by side; more go to another picture
DENSITY = 0.16  # height of the velocity density, share of a panel


def friction_curves(
    section: Section, about: Mapping[str, Any], looks: Mapping[str, Look]
) -> list[Any]:
    """Pictures of friction over velocity: a column for each identifier, rows of joints, recipes.

    Fixed numbers and the truth stand in every panel. All panels of a joint have the same axes.
    """
    # models without physics have no friction curve
    fitted = [e for e in section.of_role("fitted") if np.isfinite(e.curves).any()]
    names = list(dict.fromkeys(entry.label for entry in fitted))
    own = [[e for e in fitted if e.label == name] for name in names]
    fixed = section.of_role("given")
    if not own:
        own, fixed = [[entry] for entry in fixed], []
    parts = [own[i : i + COLUMNS] for i in range(0, len(own), COLUMNS)]
    return [_picture(part, fixed, about, looks) for part in parts]


def _picture(
    columns: Sequence[Sequence[Entry]],
    fixed: Sequence[Entry],
    about: Mapping[str, Any],
    looks: Mapping[str, Look],
) -> Any:
    recipes = list(dict.fromkeys(entry.recipe for column in columns for entry in column))
    joints = range(len(about["joints"]))
    rows = [(joint, recipe) for joint in joints for recipe in recipes]
    picture = figure(0.6 + 1.45 * len(rows))
    axes = picture.subplots(len(rows), len(columns), sharex=False, sharey=False, squeeze=False)
    shown = [entry for column in columns for entry in column] + list(fixed)
    for r, (joint, recipe) in enumerate(rows):
        limits = _limits(shown, about, joint)
        for c, column in enumerate(columns):
            axis = axes[r, c]
            own = [x for x in recipes if not c or fixed or x in {e.recipe for e in column}]
            if recipe not in own:
                axis.set_axis_off()  # nothing was fitted so
                continue
            _axes(axis, about, joint, limits)
            for entry in fixed:
                _fixed(axis, entry, about, joint, looks[entry.label])
            for entry in column:
                if entry.recipe == recipe:
                    _folds(axis, entry, about, joint, looks[entry.label])
            _truth(axis, about, joint)
            axis.tick_params(labelleft=c == 0, labelbottom=recipe == own[-1])
        beside = f", {recipe}" if len(recipes) > 1 else ""
        axes[r, 0].set_ylabel(f"{about['joints'][joint]}{plain(beside)}\n[{about['torque_unit']}]")
    for axis, column in zip(axes[0], columns, strict=True):
        axis.set_title(plain(column[0].label), color=looks[column[0].label].colour, weight="bold")
    several = [e for column in columns for e in column if e.members is not None]
    _key(picture, fixed, about, looks, several)
    picture.supxlabel(f"velocity [{about['angle_unit']}/s]", fontsize=8)
    return picture


def _grid(about: Mapping[str, Any], joint: int) -> Array:
    return np.asarray(about["velocity"], dtype=float)[:, joint]


def _limits(entries: Sequence[Entry], about: Mapping[str, Any], joint: int) -> tuple[float, float]:
    """Lower and upper end of a joint's torque axis, with room for the density below."""
    lines = [line[:, joint] for entry in entries for line in entry.curves]
    for entry in entries:
        half = spread(entry)
        if half is not None:
            lines += [entry.curves[-1, :, joint] + sign * half[:, joint] for sign in (-1, 1)]
    if about["truth"] is not None:
        lines.append(np.asarray(about["truth"], dtype=float)[:, joint])
    values = np.concatenate(lines) if lines else np.zeros(1)
    values = values[np.isfinite(values)]
    # one wild fold must not flatten all others
    high = 1.08 * float(np.quantile(np.abs(values), 0.999)) if len(values) else 0.0
    high = high or 1.0
    return -high - DENSITY * 2 * high / (1 - DENSITY), high


def _axes(axis: Any, about: Mapping[str, Any], joint: int, limits: tuple[float, float]) -> None:
    """Axes of a panel, with the velocity density as a grey area at the bottom."""
    w = _grid(about, joint)
    density = np.asarray(about["density"], dtype=float)[joint]
    edges = np.linspace(w[0], w[-1], len(density) + 1)
    # joints rest often: bars taller than nearly all others are cut, or these could not be seen
    full = float(np.quantile(density, 0.95)) or float(density.max()) or 1.0
    height = DENSITY * (limits[1] - limits[0]) * np.minimum(density / full, 1)
    axis.stairs(limits[0] + height, edges, baseline=limits[0], fill=True, color=PALE, linewidth=0)
    axis.axhline(0, color="#BBBBBB", linewidth=0.5, zorder=1)
    axis.axvline(0, color="#BBBBBB", linewidth=0.5, zorder=1)
    axis.locator_params(nbins=5)
    axis.set_xlim(float(w[0]), float(w[-1]))
    axis.set_ylim(limits)


def _folds(axis: Any, entry: Entry, about: Mapping[str, Any], joint: int, look: Look) -> None:
    w = _grid(about, joint)
    folds, overall = entry.curves[:-1, :, joint], entry.curves[-1, :, joint]
    half = spread(entry)
    if half is not None:
        low, high = (overall + sign * half[:, joint] for sign in (-1, 1))
        axis.fill_between(w, low, high, color=look.colour, alpha=OPACITY, linewidth=0)
    axis.plot(w, folds.T, color=look.colour, linewidth=0.5, alpha=0.45)
    if np.isfinite(folds).all():  # no mean where a fold has none
        axis.plot(w, folds.mean(axis=0), color=look.colour, linewidth=1.6)
    axis.plot(w, overall, color=DARK, linewidth=0.7, linestyle=(0, (1, 1.6)), zorder=4)


def _fixed(axis: Any, entry: Entry, about: Mapping[str, Any], joint: int, look: Look) -> None:
    w = _grid(about, joint)
    axis.plot(
        w, entry.curves[-1, :, joint], color=look.colour, linewidth=0.9, linestyle="--", zorder=3
    )


def _truth(axis: Any, about: Mapping[str, Any], joint: int) -> None:
    if about["truth"] is not None:
        true = np.asarray(about["truth"], dtype=float)[:, joint]
        axis.plot(_grid(about, joint), true, color=DARK, linewidth=1, linestyle=(0, (4, 1.5)))


def _key(
    picture: Any,
    fixed: Sequence[Entry],
    about: Mapping[str, Any],
    looks: Mapping[str, Look],
    several: Sequence[Entry],
) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color=GREY, linewidth=0.6, alpha=0.6),
        Line2D([], [], color=GREY, linewidth=1.6),
        Line2D([], [], color=DARK, linewidth=0.8, linestyle=(0, (1, 1.6))),
    ]
    labels = ["each fold", "mean of folds", "fit to all data"]
    if several:
        colour = looks[several[0].label].colour
        handles.append(Patch(facecolor=colour, alpha=OPACITY, linewidth=0))
        labels.append("spread of members")
    for entry in fixed:
        handles.append(Line2D([], [], color=looks[entry.label].colour, linestyle="--", linewidth=1))
        labels.append(entry.label)
    if about["truth"] is not None:
        handles.append(Line2D([], [], color=DARK, linewidth=1, linestyle=(0, (4, 1.5))))
        labels.append("truth")
    handles.append(Patch(facecolor=PALE))
    labels.append("velocity density, cut")
    key_above(picture, handles, labels)
