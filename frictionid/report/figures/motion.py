"""Motion: predicted over measured, best and worst examples, and which speeds occurred."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from frictionid.arrays import Array

from ..memory import with_loops
from ..numbers import percent, short
from ..sections import DataDescription, Model, Section, SummaryData
from ..tables import Column, Table, table_of, text_columns
from ..verdict import chosen_of
from .style import (
    COLOURS,
    DARK,
    DASHED,
    GREY,
    HALF_PAGE,
    Style,
    Styles,
    figure,
    line,
    panels,
    patch,
    plain,
)

MEASURED = "#BDBDBD"
Motion = Mapping[str, Any]


def motions(models: Sequence[Model], data: SummaryData, styles: Styles, beside: str = "") -> Any:
    """Angles of a few example motions over time, a column for each; None where there are none.

    beside : text below the time axis
    """
    by_start: dict[str, list[tuple[Motion, Style]]] = {}
    for model in models:
        for motion in model.motions:
            if motion["dataset"] == data.dataset:
                by_start.setdefault(title_of(motion), []).append((motion, styles[model.label]))
    key = {m.label: line(styles[m.label].colour, styles[m.label].line) for m in models}
    return _panels(by_start, data.description, key, beside)


def examples_of(model: Model, data: SummaryData) -> list[Motion]:
    """A model's own example motions on a data set."""
    return [example for example in model.examples if example["dataset"] == data.dataset]


def example_motions(model: Model, data: SummaryData, style: Style) -> Any:
    """Motion over time, a column for each start and a row for each joint; None without any."""
    shown = examples_of(model, data)
    key = {model.name: line(style.colour)}
    if any(example.get("band") is not None for example in shown):
        key["95 % interval"] = patch(style.colour, 0.25)
    solid = Style(style.colour, "-")
    columns = {f"{e['place']}: {title_of(e)}": [(e, solid)] for e in shown}
    return _panels(columns, data.description, key)


def _panels(
    columns: Mapping[str, Sequence[tuple[Motion, Style]]],
    data: DataDescription,
    key: Mapping[str, Any],
    beside: str = "",
) -> Any:
    """A column for each start under its title, a row for each joint; None without columns."""
    if not columns:
        return None
    measured = next(iter(columns.values()))[0][0]["measured"]
    pairs = zip(data.joints, data.position_units, strict=True)
    labels = [f"{name} [{unit}]" for name, unit in pairs][: len(measured[0])]  # others: no angle
    shown = list(columns.values())
    return panels(
        lambda axis, joint, column: _panel(axis, shown[column], joint),
        labels,
        list(columns),
        {"measured": line(MEASURED, linewidth=4), **key},
        f"time since the start of the prediction [s]{plain(beside)}",
        1.5,
        sharex="col",
    )


def title_of(motion: Motion) -> str:
    """Heading of a motion: the recording, shortened at its front, and its start [s]."""
    name = motion["recording"].rpartition("/")[2]
    name = name if len(name) <= 24 else f"…{name[-23:]}"
    return plain(f"{name} from {motion['start_s']:.2f} s")


def _panel(axis: Any, shown: Sequence[tuple[Motion, Style]], joint: int) -> None:
    last = shown[-1][0]
    measured = last["measured"][:, joint]
    axis.plot(last["time"], measured, color=MEASURED, linewidth=4, zorder=1)
    for motion, style in shown:
        time, predicted = motion["time"], motion["predicted"][:, joint]
        if motion.get("band") is not None:
            half = motion["band"][:, joint]
            edges = predicted - half, predicted + half
            axis.fill_between(time, *edges, color=style.colour, alpha=0.25, linewidth=0)
        axis.plot(time, predicted, color=style.colour, linestyle=style.line, linewidth=1.1)
    every = np.concatenate([motion["predicted"][:, joint] for motion, _ in shown])
    axis.set_ylim(limits_of(measured, every))
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


def velocity_scatter(section: Section) -> Any:
    """Each joint's velocity over the first one's, and how often each occurred, beside loops."""
    data, w = section.description, section.description.velocities
    if w is None or not with_loops(section):
        return None
    n = w.shape[1]
    units = zip(data.joints, data.position_units, strict=True)
    names = [f"{plain(name)} [{unit}/s]" for name, unit in units]
    picture = figure(2.5, 7.2 if n > 1 else 3.6)
    axes = picture.subplots(1, 2 * n - 1, squeeze=False)[0]
    dots = {"s": 2, "color": COLOURS[0], "alpha": 0.35, "linewidths": 0, "rasterized": True}
    for joint, axis in enumerate(axes[: n - 1], 1):
        axis.scatter(w[:, 0], w[:, joint], **dots)
        axis.set(xlabel=names[0], ylabel=names[joint])
    for joint, axis in enumerate(axes[n - 1 :]):
        axis.hist(w[:, joint], 60, color=GREY)
        label = "samples shown" if joint == 0 else ""
        axis.set(yscale="log", xlabel=names[joint], ylabel=label)
    return picture


def speed_table(dataset: str, data: DataDescription) -> Table | None:
    """How fast the joints were: levels that shares of the samples stay below; None if unknown."""
    if data.speeds is None:
        return None
    unit = data.velocity_unit
    levels = [Column(percent(level), "speed below which", unit) for level in data.speeds["levels"]]
    rows = [
        [name, percent(s["rest"]), *map(short, s["speeds"]), short(s["reversals"])]
        for name, s in zip(data.joints, data.speeds["joints"], strict=True)
    ]
    caption = (
        f"{dataset}: speeds of the joints; at rest is below 0.05 {unit}, or 1 % of the speeds of "
        "slower joints."
    )
    heads = (*text_columns("joint"), "at rest", *levels, Column("reversals", unit="1/s"))
    return table_of(heads, rows, caption, f"speeds-{dataset}")


def predicted_figure(table: pd.DataFrame, joints: Sequence[str], units: Sequence[str]) -> Any:
    """Angles over time, a row for each joint: measured, and predicted from each start.

    table : of `predicted_motion`, of one recording
    """

    def draw(axis: Any, joint: int, _column: int) -> None:
        for _, start in table.groupby("start_s", sort=False):
            measured = start[f"measured_q{joint + 1}"]
            axis.plot(start["time_s"], measured, color=MEASURED, linewidth=4, zorder=1)
            axis.plot(start["time_s"], start[f"q{joint + 1}"], color=COLOURS[0], linewidth=1.1)
        axis.margins(x=0)

    labels = [f"{plain(name)} [{unit}]" for name, unit in zip(joints, units, strict=True)]
    key = {"measured": line(MEASURED, linewidth=4), "predicted": line(COLOURS[0])}
    below = f"time [s], {plain(str(table['recording'].iloc[0]))}"
    return panels(draw, labels, [""], key, below, 1.5, sharex=True)


def torque_over_time(section: Section, styles: Styles) -> Any:
    """Measured torque of each joint over time, and that of the model that the verdict names.

    What lies between rigid bodies alone and the whole model is friction. None without torques.
    """
    chosen, data = chosen_of(section), section.description
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
    return panels(draw, labels, [""], key, below, 0.75, HALF_PAGE, sharex=True)
