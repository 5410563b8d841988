"""Friction curves: all folds and their mean, the truth, and how often each speed occurred."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.report.figures.panels import draw_truth, side_by_side, velocity_axis
from frictionid.report.figures.style import (
    DARK,
    DASHED,
    GREY,
    PALE,
    Style,
    figure,
    key_above,
    line,
    patch,
    plain,
)
from frictionid.report.sections import DataDescription, Model, Section

COLUMNS = 4  # models side by side; more go to another picture
DENSITY = 0.16  # height of the velocity density, share of a panel
DOTTED = (0, (1, 1.6))


def friction_curves(section: Section, styles: Mapping[str, Style]) -> list[Any]:
    """Pictures of friction over velocity: a column for each model, a row for each joint.

    Fixed numbers and the truth stand in every panel. All panels of a joint have the same axes.
    """
    # models without physics have no friction curve
    fitted = [m for m in section.of_role("fitted") if np.isfinite(m.curves).any()]
    names = list(dict.fromkeys(m.label for m in fitted))
    columns = sorted(fitted, key=lambda m: names.index(m.label))  # recipes of one law side by side
    given = section.of_role("given")
    if not columns:
        columns, given = given, []
    data = section.description
    limits = [_limits([*columns, *given], data, joint) for joint in range(len(data.joints))]
    parts = side_by_side(columns, COLUMNS)
    return [_picture(part, given, (data, limits), styles) for part in parts]


def _picture(
    columns: Sequence[Model],
    given: Sequence[Model],
    place: tuple[DataDescription, Sequence[tuple[float, float]]],
    styles: Mapping[str, Style],
) -> Any:
    """A picture; `place` is the data set, and the ends of the joints' torque axes."""
    data, limits = place
    picture = figure(0.6 + 1.75 * len(limits))
    axes = picture.subplots(len(limits), len(columns), squeeze=False)
    for joint, row in enumerate(axes):
        for axis, model in zip(row, columns, strict=True):
            _panel(axis, model, given, (data, joint, limits[joint]), styles)
            axis.tick_params(labelleft=axis is row[0], labelbottom=joint == len(limits) - 1)
        row[0].set_ylabel(f"{data.joints[joint]}\n[{data.torque_units[joint]}]")
    for axis, model in zip(axes[0], columns, strict=True):
        axis.set_title(plain(model.name), color=styles[model.label].colour, weight="bold")
    key_above(picture, _key(given, data, styles))
    picture.supxlabel(f"velocity [{data.velocity_unit}]", fontsize=8)
    return picture


def _panel(
    axis: Any,
    model: Model,
    given: Sequence[Model],
    place: tuple[DataDescription, int, tuple[float, float]],
    styles: Mapping[str, Style],
) -> None:
    """Curves of a model and a joint; `place`: data set, joint, and ends of its torque axis."""
    data, joint, limits = place
    w = data.velocity[:, joint]
    _density(axis, data, joint, limits)
    velocity_axis(axis, w, limits)
    for other in given:
        colour = styles[other.label].colour
        axis.plot(w, other.curves[-1, :, joint], "--", color=colour, linewidth=0.9, zorder=3)
    _folds(axis, model, data, joint, styles[model.label].colour)
    draw_truth(axis, data, joint)


def _limits(models: Sequence[Model], data: DataDescription, joint: int) -> tuple[float, float]:
    """Lower and upper end of a joint's torque axis, with room for the density below."""
    lines = [line[:, joint] for model in models for line in model.curves]
    if data.truth is not None:
        lines.append(data.truth[:, joint])
    values = np.concatenate(lines) if lines else np.zeros(1)
    values = values[np.isfinite(values)]
    # one wild fold must not flatten all others
    high = 1.08 * float(np.quantile(np.abs(values), 0.999)) if len(values) else 0.0
    high = high or 1.0
    return -high - DENSITY * 2 * high / (1 - DENSITY), high


def _density(axis: Any, data: DataDescription, joint: int, limits: tuple[float, float]) -> None:
    """The velocity density as a grey area at the bottom."""
    w, density = data.velocity[:, joint], data.density[joint]
    edges = np.linspace(w[0], w[-1], len(density) + 1)
    # joints rest often: bars taller than nearly all others are cut, or these could not be seen
    full = float(np.quantile(density, 0.95)) or float(density.max()) or 1.0
    height = DENSITY * (limits[1] - limits[0]) * np.minimum(density / full, 1)
    axis.stairs(limits[0] + height, edges, baseline=limits[0], fill=True, color=PALE, linewidth=0)


def _folds(axis: Any, model: Model, data: DataDescription, joint: int, colour: str) -> None:
    w = data.velocity[:, joint]
    folds, overall = model.curves[:-1, :, joint], model.curves[-1, :, joint]
    axis.plot(w, folds.T, color=colour, linewidth=0.5, alpha=0.45)
    if np.isfinite(folds).all():  # no mean where a fold has none
        axis.plot(w, folds.mean(axis=0), color=colour, linewidth=1.6)
    axis.plot(w, overall, color=DARK, linewidth=0.7, linestyle=DOTTED, zorder=4)


def _key(
    given: Sequence[Model],
    data: DataDescription,
    styles: Mapping[str, Style],
) -> dict[str, Any]:
    key = {
        "each fold": line(GREY, linewidth=0.6, alpha=0.6),
        "mean of folds": line(GREY, linewidth=1.6),
        "fit to all data": line(DARK, DOTTED, 0.8),
    }
    key |= {model.label: line(styles[model.label].colour, "--", 1) for model in given}
    if data.truth is not None:
        key["truth"] = line(DARK, DASHED, 1)
    return {**key, "velocity density, cut": patch(PALE)}
