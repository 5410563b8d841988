"""Predicted over measured motion, from initial states that no fit has seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import Style, figure, key_above, line, plain
from frictionid.report.sections import Model, SummaryData

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
