"""Charts of the page: what Plotly draws on the screen, as plain documents of data and layout."""

import gzip
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array, evenly

from .figures.curves import curve_and_band, density_heights
from .figures.motion import limits_of
from .figures.style import DARK, DENSITY, PALE, Style, Styles, measured, most
from .sections import DataDescription, Model, Section

DIGITS = 5  # significant, of numbers in a chart
MEASURED = "#8C8C8C"
SILENT: Mapping[str, Any] = {"hoverinfo": "skip", "showlegend": False}
FRICTION = {"yaxis": "y2"}  # above the density of speeds
MOST = 161  # velocities of a line
MOST_SAMPLES = 241  # samples of a line over time
ALWAYS = 3  # curves that are all shown; of more, only the chosen one is at first
PARTS = ("measured", "predicted")
ROOM = 0.08  # about the drawing, of its size

Example = Mapping[str, Any]


class Chart(NamedTuple):
    """A chart: a heading, what it shows in words, and Plotly's data, axes and frames.

    The page's script adds what all charts look like, and the controls of an animation.

    height : [px]
    """

    heading: str
    words: str
    data: list[dict[str, Any]]
    layout: dict[str, Any]
    frames: list[dict[str, Any]] = []
    height: int = 340


@cache
def plotly_script() -> bytes:
    """The library that draws charts, compressed; empty without it: the page shows pictures then."""
    if find_spec("plotly") is None:
        return b""
    from plotly.offline import get_plotlyjs

    return gzip.compress(get_plotlyjs().encode(), 9, mtime=0)


def numbers(values: Array) -> list[float | None]:
    """Numbers (N,) for a chart; what is not finite leaves a gap.

    >>> numbers(np.array([1 / 3, np.nan]))
    [0.33333, None]
    """
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values.tolist()]


def line(x: Array, y: Array, name: str, style: Mapping[str, Any]) -> dict[str, Any]:
    """A line; `style` are Plotly's attributes of a scatter trace."""
    trace = {"type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y)}
    return {**trace, "name": escape(name), **style}


def band(
    x: Array, middle: Array, half: Array, colour: str, style: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """A band about a line (N,), where it is known."""
    finite = np.isfinite(middle) & np.isfinite(half)
    if not finite.any():
        return []
    x, middle, half = x[finite], middle[finite], half[finite]
    round_trip = np.concatenate([x, x[::-1]])
    edge = np.concatenate([middle + half, (middle - half)[::-1]])
    fill = {"fill": "toself", "fillcolor": pale(colour), "line": {"width": 0}}
    return [line(round_trip, edge, "", {**fill, **SILENT, **style})]


def pale(colour: str, alpha: float = 0.22) -> str:
    """A colour that lets others through.

    >>> pale("#0072B2", 0.5)
    'rgba(0,114,178,0.5)'
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha})"


def dash(linestyle: Any) -> str:
    """Plotly's name of a kind of line of Matplotlib."""
    if linestyle == "-":
        return "solid"
    return "dash" if linestyle == "--" or len(linestyle[1]) == 2 else "dashdot"


def axis(title: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """An axis with its title, which names the unit."""
    return {"title": {"text": escape(title)}, **changes}


# --- Friction over velocity -----------------------------------------------------------------------


def friction_charts(section: Section, styles: Styles, chosen: Model | None) -> list[Chart]:
    """A chart for each joint; none where no model has friction.

    chosen : the model that is shown at first, and with its folds; a click shows others
    """
    models = [m for m in section.of_role("fitted", "given") if np.isfinite(m.curves[-1]).any()]
    models.sort(key=lambda m: m is not chosen)
    return [
        _friction_chart(section.description, joint, models, styles)
        for joint in range(len(section.description.joints))
        if models
    ]


def _friction_chart(
    data: DataDescription, joint: int, models: Sequence[Model], styles: Styles
) -> Chart:
    """The curves of a joint; that of the first model with its folds."""
    w, traces = data.velocity[:, joint], []
    few = evenly(len(w), MOST)
    for i, model in enumerate(models):
        shown = True if len(models) <= ALWAYS or i == 0 else "legendonly"
        group = {"legendgroup": f"model {i}", "visible": shown, **FRICTION}
        style, curves = styles[model.label], model.curves[:, few, joint]
        x, middle, half = curve_and_band(model, data, joint)
        places = evenly(len(x), MOST)
        traces += band(x[places], middle[places], half[places], style.colour, group)
        thin = {"color": pale(style.colour, 0.4), "width": 0.7}
        for fold in curves[:-1] if i == 0 else ():
            traces.append(line(w[few], fold, "", {"line": thin, **SILENT, **group}))
        pen = {"color": style.colour, "width": 2, "dash": dash(style.line)}
        traces.append(line(w[few], curves[-1], model.curve_name, {"line": pen, **group}))
    if data.truth is not None:
        drawn = {"color": DARK, "width": 1.6, "dash": "dash"}
        traces.append(line(w[few], data.truth[few, joint], "truth", {"line": drawn, **FRICTION}))
    edges, heights = density_heights(data, joint)
    area = {"line": {"width": 0, "shape": "hv"}, "fill": "tozeroy", "fillcolor": PALE}
    steps = np.append(heights, heights[-1])
    traces.append(line(edges, steps, "speeds that occurred", {"hoverinfo": "skip", **area}))
    above = {"overlaying": "y", "range": _range(models, data, joint), "hoverformat": ".4g"}
    above["tickmode"] = "auto"  # not those of the hidden axis
    velocities = {"hoverformat": ".3g", "range": [w[0], w[-1]]}
    axes = {
        "xaxis": axis(f"velocity [{data.position_units[joint]}/s]", velocities),
        "yaxis": {"range": [0, 1 / DENSITY], "visible": False, "fixedrange": True},
        "yaxis2": axis(f"friction [{data.torque_units[joint]}]", above),
    }
    words = (
        "Friction over velocity: fit to all data with its 95 % band, each fold (thin), "
        "grey: how often each speed occurred. A click on a name shows or hides a model."
    )
    return Chart(data.joints[joint], words, traces, axes, height=320 + 20 * len(models))


def _range(models: Sequence[Model], data: DataDescription, joint: int) -> list[float]:
    """Ends of the friction axis, with room for the density; one wild fold must not flatten all."""
    curves = [model.curves[:, :, joint].ravel() for model in models]
    curves += [] if data.truth is None else [data.truth[:, joint]]
    velocity, curve, half = curve_and_band(models[0], data, joint)
    curves.append((np.abs(curve) + half)[measured(velocity, data, joint)])
    high = 1.1 * most([np.abs(curve[np.isfinite(curve)]) for curve in curves])
    return [-high - DENSITY * 2 * high / (1 - DENSITY), high]


# --- Predicted over measured motion from one start ------------------------------------------------


def motion_chart(example: Example, data: DataDescription, style: Style) -> Chart:
    """The joints' positions over time, one above the other."""
    time, *motions = (example[part] for part in ("time", *PARTS))
    n = motions[0].shape[1]  # coupled parts have no angle
    widths = example.get("band")
    half = np.zeros_like(motions[0]) if widths is None else widths
    banded = bool(half.any())  # not of fixed numbers, the same in every fold
    few, traces = evenly(len(time), MOST_SAMPLES), []
    axes: dict[str, Any] = {}
    for j, name in enumerate(data.joints[:n]):
        panel = {"xaxis": "x", "yaxis": f"y{j + 1}"}
        measured, predicted = (motion[:, j] for motion in motions)
        low, high = limits_of(measured, predicted)
        predicted = np.where((predicted >= low) & (predicted <= high), predicted, np.nan)
        if banded:
            edges = np.minimum(half[few, j], high - low)
            traces += band(time[few], predicted[few], edges, style.colour, panel)
        for part, values, pen in (
            ("measured", measured, {"color": MEASURED, "width": 5}),
            ("predicted", predicted, {"color": style.colour, "width": 2}),
        ):
            look = {"line": pen, **panel, "showlegend": j == 0}
            traces.append(line(time[few], values[few], part, look))
        top = 1 - j / n
        place = {"domain": [top - 0.92 / n if n > 1 else 0, top], "range": (low, high)}
        shown = {**place, "hoverformat": ".4g", "nticks": 5}
        axes[f"yaxis{j + 1}"] = axis(f"{name} [{data.position_units[j]}]", shown)
    below = {"anchor": f"y{n}", "hoverformat": ".3f"}
    axes["xaxis"] = axis("time since the start [s]", below)
    words = "Measured (grey) and predicted motion"
    words += "; the band is the 95 % interval of the prediction." if banded else "."
    return Chart("", words, traces, axes, height=130 + 120 * n)


def animation(example: Example, style: Style) -> Chart | None:
    """The mechanism, measured against predicted; None where it has no drawing."""
    drawing = example.get("drawing")
    if not drawing:
        return None
    time, *motions = (drawing[part] for part in ("time", *PARTS))
    lines = side_view(motions)
    drawn = [
        {"line": {"color": MEASURED, "width": 9}, "marker": {"size": 11, "color": MEASURED}},
        {"line": {"color": style.colour, "width": 3}, "marker": {"size": 6, "color": style.colour}},
    ]
    traces = [
        line(
            ends[0, :, 0],
            ends[0, :, 1],
            part,
            {"mode": "lines+markers", "hoverinfo": "skip", **look},
        )
        for part, ends, look in zip(PARTS, lines, drawn, strict=True)
    ]
    frames = [
        {
            "name": f"{t:.3f}",
            "data": [dict(zip("xy", map(numbers, ends[k].T), strict=True)) for ends in lines],
            "traces": [0, 1],
        }
        for k, t in enumerate(time)
    ]
    words = "The mechanism, measured (grey) against predicted, in real time."
    return Chart("", words, traces, _plane(lines), frames, 440)


def side_view(lines: list[Array]) -> list[Array]:
    """Lines (f, k, 2) of lines (f, k, 2 or 3) in the vertical plane in which they are widest.

    >>> side_view([np.array([[[0.0, 0.0, 0.0], [0.0, 2.0, 1.0]]])])[0].round(9).tolist()
    [[[0.0, 0.0], [2.0, 1.0]]]
    """
    if lines[0].shape[-1] == 2:
        return lines
    flat = np.concatenate([ends[..., :2].reshape(-1, 2) for ends in lines])
    flat = flat[np.isfinite(flat).all(axis=1)]
    direction = np.linalg.svd(flat - flat.mean(axis=0))[2][0] if len(flat) else np.array([1.0, 0.0])
    direction = direction * (1.0 if direction.sum() >= 0 else -1.0)
    return [np.stack([ends[..., :2] @ direction, ends[..., 2]], axis=-1) for ends in lines]


def _plane(lines: list[Array]) -> dict[str, Any]:
    """Axes with the same scale, around everything that is ever drawn."""
    every = np.concatenate([ends.reshape(-1, 2) for ends in lines])
    low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
    reach = (0.5 + ROOM) * max(float((high - low).max()), 1e-3)
    ends = [[float(middle - reach), float(middle + reach)] for middle in (low + high) / 2]
    shown = {"constrain": "domain", "nticks": 5, "automargin": False, "tickangle": 0}
    return {
        "xaxis": axis("x [m]", {"range": ends[0], **shown}),
        "yaxis": axis("height [m]", {"range": ends[1], "scaleanchor": "x", **shown}),
    }
