"""Motion: predicted over measured, best and worst examples, and which speeds occurred."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.report.figures.style import (
    COLOURS,
    GREY,
    Style,
    figure,
    key_above,
    line,
    patch,
    plain,
)
from frictionid.report.numbers import percent, short
from frictionid.report.sections import DataDescription, Model, SummaryData
from frictionid.report.tables import Column, Table, text_columns
from frictionid.report.tables import line as table_line

MEASURED = "#BDBDBD"
Motion = Mapping[str, Any]


def motions(
    models: Sequence[Model], data: SummaryData, styles: Mapping[str, Style], beside: str = ""
) -> Any:
    """Angles of a few example motions over time, a column for each; None where there are none.

    beside : text below the time axis
    """
    by_start: dict[tuple[str, float], list[tuple[Model, Motion]]] = {}
    for model in models:
        for motion in (m for m in model.motions if m["dataset"] == data.dataset):
            start = str(motion["recording"]), float(motion["start_s"])
            by_start.setdefault(start, []).append((model, motion))
    if not by_start:
        return None
    description = data.description
    some = next(iter(by_start.values()))[0][1]
    names = description.joints[: _series(some["measured"]).shape[1]]  # coupled parts have no angle
    picture = figure(0.65 + 1.5 * len(names))
    axes = picture.subplots(len(names), len(by_start), sharex="col", squeeze=False)
    for column, (start, shown) in zip(axes.T, by_start.items(), strict=True):
        for joint, axis in enumerate(column):
            _panel(axis, shown, joint, styles)
        column[0].set_title(title_of(*start), fontsize=7, loc="left")
    for joint, (axis, name) in enumerate(zip(axes[:, 0], names, strict=True)):
        axis.set_ylabel(f"{name} [{description.position_units[joint]}]")
    text = "time since the start of the prediction [s]"
    picture.supxlabel(f"{text}{plain(beside)}", fontsize=8)
    key = {m.label: line(styles[m.label].colour, styles[m.label].line) for m in models}
    key_above(picture, {"measured": line(MEASURED, linewidth=4), **key})
    return picture


def title_of(recording: str, start: float) -> str:
    """Heading of a motion: the recording, shortened at its front, and its start [s]."""
    name = recording.rpartition("/")[2]
    name = name if len(name) <= 24 else f"…{name[-23:]}"
    return plain(f"{name} from {start:.2f} s")


def _panel(
    axis: Any, shown: Sequence[tuple[Model, Motion]], joint: int, styles: Mapping[str, Style]
) -> None:
    example = shown[-1][1]
    measured = _series(example["measured"])[:, joint]
    axis.plot(_series(example["time"]), measured, color=MEASURED, linewidth=4, zorder=1)
    lines = [_series(motion["predicted"])[:, joint] for _, motion in shown]
    for (model, motion), predicted in zip(shown, lines, strict=True):
        style, time = styles[model.label], _series(motion["time"])
        axis.plot(time, predicted, color=style.colour, linestyle=style.line, linewidth=1.1)
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    room = max(0.6 * (high - low), 0.3)  # predictions that leave it have diverged
    every = np.concatenate([*lines, measured])
    every = every[np.isfinite(every)]
    axis.set_ylim(
        max(low - room, float(every.min()) - 0.05 * room),
        min(high + room, float(every.max()) + 0.05 * room),
    )
    axis.margins(x=0)


def _series(values: Any) -> Array:
    """Numbers of a JSON list; what is not finite leaves a gap."""
    array = np.asarray(values, dtype=float)
    return np.where(np.isfinite(array), array, np.nan)


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
            _example_panel(axis, example, joint, style)
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


def _example_panel(axis: Any, example: Mapping[str, Any], joint: int, style: Style) -> None:
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


def velocity_scatter(data: DataDescription, w: Array) -> Any:
    """Picture of each joint's velocity (N, n) over the first one's, and how often each occurred."""
    n = w.shape[1]
    units = zip(data.joints, data.position_units, strict=True)
    names = [f"{plain(name)} [{unit}/s]" for name, unit in units]
    picture = figure(2.5, 7.2 if n > 1 else 3.6)
    axes = picture.subplots(1, max(n - 1, 0) + n, squeeze=False)[0]
    for joint in range(1, n):
        axis = axes[joint - 1]
        axis.scatter(
            w[:, 0], w[:, joint], s=2, color=COLOURS[0], alpha=0.35, linewidths=0, rasterized=True
        )
        axis.set_xlabel(names[0])
        axis.set_ylabel(names[joint])
    for joint in range(n):
        axis = axes[n - 1 + joint]
        axis.hist(w[:, joint], 60, color=GREY)
        axis.set_yscale("log")
        axis.set_xlabel(names[joint])
        axis.set_ylabel("samples shown" if joint == 0 else "")
    return picture


def speed_table(dataset: str, data: DataDescription, speeds: Any) -> Table:
    """How fast the joints were: levels that shares of the samples stay below."""
    unit = data.velocity_unit
    columns = [*text_columns("joint"), Column("at rest")]
    columns += [Column(percent(level), "speed below which", unit) for level in speeds["levels"]]
    lines = [
        table_line(
            [name, percent(own["rest"]), *map(short, own["speeds"]), short(own["reversals"])]
        )
        for name, own in zip(data.joints, speeds["joints"], strict=True)
    ]
    caption = (
        f"{dataset}: speeds of the joints; at rest is below 0.05 {unit}, or 1 % of the speeds of "
        "slower joints."
    )
    heads = (*columns, Column("reversals", "", "1/s"))
    return Table(caption, f"speeds-{dataset}", heads, tuple(lines))


def predicted_figure(table: pd.DataFrame, joints: Sequence[str], units: Sequence[str]) -> Any:
    """Angles over time, a row for each joint: measured, and predicted from each start.

    table : of `predicted_motion`, of one recording
    """
    picture = figure(0.55 + 1.5 * len(joints))
    axes = picture.subplots(len(joints), 1, sharex=True, squeeze=False)[:, 0]
    for j, axis in enumerate(axes):
        for _, own in table.groupby("start_s", sort=False):
            measured = own[f"measured_q{j + 1}"]
            axis.plot(own["time_s"], measured, color=MEASURED, linewidth=4, zorder=1)
            axis.plot(own["time_s"], own[f"q{j + 1}"], color=COLOURS[0], linewidth=1.1)
        axis.set_ylabel(f"{plain(joints[j])} [{units[j]}]")
        axis.margins(x=0)
    axes[-1].set_xlabel(f"time [s], {plain(str(table['recording'].iloc[0]))}")
    keys = {"measured": line(MEASURED, linewidth=4), "predicted": line(COLOURS[0])}
    key_above(picture, keys)
    return picture
