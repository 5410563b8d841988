"""Predicted over measured motion of one model from its best, median and worst start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.motion import MEASURED, title_of
from frictionid.report.figures.style import Style, figure, key_above, line, patch
from frictionid.report.sections import Model, SummaryData


def examples_of(model: Model, data: SummaryData) -> list[Mapping[str, Any]]:
    """A model's own example motions on a data set."""
    return [example for example in model.examples if example["dataset"] == data.dataset]


def example_motions(model: Model, data: SummaryData, style: Style) -> Any:
    """Motion over time, a column for each start and a row for each joint; None without any."""
    shown, description = examples_of(model, data), data.description
    if not shown:
        return None
    names = description.joints[: len(shown[0]["measured"][0])]  # coupled parts have no angle
    picture = figure(0.65 + 1.5 * len(names))
    axes = picture.subplots(len(names), len(shown), sharex="col", squeeze=False)
    for column, example in zip(axes.T, shown, strict=True):
        for joint, axis in enumerate(column):
            _panel(axis, example, joint, style)
        heading = f"{example['place']}: {title_of(example['recording'], example['start_s'])}"
        column[0].set_title(heading, fontsize=7, loc="left")
    for joint, (axis, name) in enumerate(zip(axes[:, 0], names, strict=True)):
        axis.set_ylabel(f"{name} [{description.position_units[joint]}]")
    picture.supxlabel("time since the start of the prediction [s]", fontsize=8)
    key = {"measured": line(MEASURED, linewidth=4), model.name: line(style.colour)}
    if any(example.get("band") for example in shown):
        key["95 % interval"] = patch(style.colour, 0.25)
    key_above(picture, key)
    return picture


def _panel(axis: Any, example: Mapping[str, Any], joint: int, style: Style) -> None:
    time, measured, predicted = (
        np.asarray(example[name], dtype=float) for name in ("time", "measured", "predicted")
    )
    low, high = limits_of(measured[:, joint], predicted[:, joint])
    axis.plot(time, measured[:, joint], color=MEASURED, linewidth=4, zorder=1)
    if example.get("band"):
        half = np.asarray(example["band"], dtype=float)[:, joint]
        edges = predicted[:, joint] - half, predicted[:, joint] + half
        axis.fill_between(time, *edges, color=style.colour, alpha=0.25, linewidth=0)
    axis.plot(time, predicted[:, joint], color=style.colour, linewidth=1.1)
    axis.set_ylim(low, high)
    axis.margins(x=0)


def limits_of(measured: Array, predicted: Array) -> tuple[float, float]:
    """Ends of an axis about measured positions; predictions that leave it have diverged.

    >>> limits_of(np.array([0.0, 1.0]), np.array([0.0, 9.0]))
    (-0.08, 1.68)
    """
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    room = max(0.6 * (high - low), 0.3)
    every = np.concatenate([measured, predicted])
    every = every[np.isfinite(every)]
    low, high = max(low - room, float(every.min())), min(high + room, float(every.max()))
    edge = 0.05 * (high - low) or 0.01  # of a joint at rest, too
    return round(low - edge, 9), round(high + edge, 9)
