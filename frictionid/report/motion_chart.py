"""Predicted over measured motion from one start on the screen, as lines and as an animation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.charts import (
    MEASURED,
    Chart,
    as_array,
    axis,
    band,
    layout,
    line,
    numbers,
    thinned,
)
from frictionid.report.figures.motion import limits_of
from frictionid.report.figures.style import Style
from frictionid.report.sections import DataDescription

MOST_SAMPLES = 241  # samples of a line
PARTS = ("measured", "predicted")
ROOM = 0.08  # about the drawing, of its size

Example = Mapping[str, Any]


def motion_chart(example: Example, data: DataDescription, style: Style) -> Chart:
    """The joints' positions over time, one above the other."""
    time = as_array(example["time"])
    some = thinned(len(time), MOST_SAMPLES)
    widths = example.get("band")
    half = None if widths is None else as_array(widths)
    if half is not None and not half.any():
        half = None  # fixed numbers, the same in every fold
    traces, axes = [], {}
    n = len(example["measured"][0])  # coupled parts have no angle
    for j, name in enumerate(data.joints[:n]):
        panel = {"xaxis": "x", "yaxis": f"y{j + 1}"}
        measured, predicted = (as_array(example[part])[:, j] for part in PARTS)
        limits = limits_of(measured, predicted)
        predicted = np.where((predicted >= limits[0]) & (predicted <= limits[1]), predicted, np.nan)
        grey = {"color": MEASURED, "width": 5}
        own = {"color": style.colour, "width": 2}
        if half is not None:
            edges = np.minimum(half[some, j], limits[1] - limits[0])
            traces += band(time[some], predicted[some], edges, style.colour, panel)
        named = {**panel, "showlegend": j == 0}
        traces.append(line(time[some], measured[some], "measured", {"line": grey, **named}))
        traces.append(line(time[some], predicted[some], "predicted", {"line": own, **named}))
        top = 1 - j / n
        place = {"domain": [top - 0.92 / n if n > 1 else 0, top], "range": limits}
        shown = {**place, "hoverformat": ".4g", "nticks": 5}
        axes[f"yaxis{j + 1}"] = axis(f"{name} [{data.position_units[j]}]", shown)
    below = {"anchor": f"y{n}", "hoverformat": ".3f"}
    axes["xaxis"] = axis("time since the start [s]", below)
    words = "Measured (grey) and predicted motion; the band is the 95 % interval of the prediction."
    if half is None:
        words = "Measured (grey) and predicted motion."
    return Chart("", words, traces, layout(axes), height=130 + 120 * n)


def animation(example: Example, style: Style) -> Chart | None:
    """The mechanism, measured against predicted; None where it has no drawing."""
    drawing = example.get("drawing")
    if not drawing:
        return None
    time = as_array(drawing["time"])
    lines = side_view([as_array(drawing[part]) for part in PARTS])
    drawn = [
        {"line": {"color": MEASURED, "width": 9}, "marker": {"size": 11, "color": MEASURED}},
        {"line": {"color": style.colour, "width": 3}, "marker": {"size": 6, "color": style.colour}},
    ]
    traces = [
        line(
            own[0][:, 0], own[0][:, 1], part, {"mode": "lines+markers", "hoverinfo": "skip", **look}
        )
        for part, own, look in zip(PARTS, lines, drawn, strict=True)
    ]
    frames = [
        {
            "name": f"{t:.3f}",
            "data": [dict(zip("xy", map(numbers, own[k].T), strict=True)) for own in lines],
            "traces": [0, 1],
        }
        for k, t in enumerate(time)
    ]
    step = 1e3 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    controls = {"updatemenus": [_buttons(step)], "sliders": [_slider(time)]}
    words = "The mechanism, measured (grey) against predicted, in real time."
    return Chart("", words, traces, layout({**_plane(lines), **controls}), frames, height=440)


def side_view(lines: list[Array]) -> list[Array]:
    """Lines (f, k, 2) of lines (f, k, 2 or 3) in the vertical plane in which they are widest.

    >>> side_view([np.array([[[0.0, 0.0, 0.0], [0.0, 2.0, 1.0]]])])[0].round(9).tolist()
    [[[0.0, 0.0], [2.0, 1.0]]]
    """
    if lines[0].shape[-1] == 2:
        return lines
    flat = np.concatenate([own[..., :2].reshape(-1, 2) for own in lines])
    flat = flat[np.isfinite(flat).all(axis=1)]
    direction = np.linalg.svd(flat - flat.mean(axis=0))[2][0] if len(flat) else np.array([1.0, 0.0])
    direction = direction * (1.0 if direction.sum() >= 0 else -1.0)
    return [np.stack([own[..., :2] @ direction, own[..., 2]], axis=-1) for own in lines]


def _plane(lines: list[Array]) -> dict[str, Any]:
    """Axes with the same scale, around everything that is ever drawn."""
    every = np.concatenate([own.reshape(-1, 2) for own in lines])
    low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
    reach = (0.5 + ROOM) * max(float((high - low).max()), 1e-3)
    ends = [[float(middle - reach), float(middle + reach)] for middle in (low + high) / 2]
    shown = {"constrain": "domain", "nticks": 5, "automargin": False, "tickangle": 0}
    return {
        "xaxis": axis("x [m]", {"range": ends[0], **shown}),
        "yaxis": axis("height [m]", {"range": ends[1], "scaleanchor": "x", **shown}),
        "margin": {"l": 52, "r": 10, "t": 34, "b": 130, "autoexpand": False},
    }


def _buttons(step: float) -> dict[str, Any]:
    """Play and pause."""
    play = {
        "frame": {"duration": step, "redraw": False},
        "transition": {"duration": 0},
        "fromcurrent": True,
        "mode": "immediate",
    }
    pause = {"frame": {"duration": 0, "redraw": False}, "mode": "immediate"}
    return {
        "type": "buttons",
        "direction": "left",
        "x": 0,
        "y": -0.17,  # below the labels of the axis
        "xanchor": "left",
        "yanchor": "top",
        "showactive": False,
        "pad": {"t": 0, "r": 6},
        "buttons": [
            {"label": "▶ play", "method": "animate", "args": [None, play]},
            {"label": "❚❚ pause", "method": "animate", "args": [[None], pause]},
        ],
    }


def _slider(time: Array) -> dict[str, Any]:
    """The time of the drawing."""
    now = {"frame": {"duration": 0, "redraw": False}, "mode": "immediate"}
    steps = [{"label": f"{t:.2f}", "method": "animate", "args": [[f"{t:.3f}"], now]} for t in time]
    return {
        "steps": steps,
        "x": 0,
        "len": 1.0,
        "y": -0.28,  # below the buttons
        "yanchor": "top",
        "pad": {"t": 0, "b": 0},
        "ticklen": 0,
        "minorticklen": 0,
        "font": {"color": "rgba(0,0,0,0)"},
        "currentvalue": {"prefix": "time ", "suffix": " s", "font": {"size": 12, "color": "#222"}},
    }
