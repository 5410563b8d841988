"""Charts of the page: what Plotly draws on the screen, as plain documents of data and layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.example_motions import FEWEST, jackknife_width
from frictionid.report.figures.curves import band_of
from frictionid.report.figures.panels import most
from frictionid.report.figures.style import DARK, PALE, Style
from frictionid.report.sections import DataDescription, Model, Section

DIGITS = 5  # significant, of numbers in a chart
MEASURED = "#8C8C8C"
GRID = "#E6E6E6"
SILENT: Mapping[str, Any] = {"hoverinfo": "skip", "showlegend": False}


class Chart(NamedTuple):
    """A chart: a heading, what it shows in words, and Plotly's data, layout and frames.

    height : [px]
    """

    heading: str
    words: str
    data: list[dict[str, Any]]
    layout: dict[str, Any]
    frames: list[dict[str, Any]] = []
    height: int = 340

    @property
    def document(self) -> dict[str, Any]:
        """What Plotly draws."""
        return {"data": self.data, "layout": self.layout, "frames": self.frames}


@cache
def plotly_script() -> bytes:
    """The library that draws charts, compressed; empty without it: the page shows pictures then."""
    import gzip

    if find_spec("plotly") is None:
        return b""
    from plotly.offline import get_plotlyjs

    return gzip.compress(get_plotlyjs().encode(), 9, mtime=0)


def numbers(values: Array) -> list[float | None]:
    """Numbers (N,) for a chart; what is not finite leaves a gap.

    >>> numbers(np.array([1 / 3, np.nan]))
    [0.33333, None]
    """
    return [
        float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in np.asarray(values).tolist()
    ]


def line(x: Array, y: Array, name: str, style: Mapping[str, Any]) -> dict[str, Any]:
    """A line; `style` are Plotly's attributes of a scatter trace."""
    trace = {"type": "scatter", "mode": "lines", "x": numbers(x), "y": numbers(y)}
    return {**trace, "name": escape(name), **style}


def band(
    x: Array, middle: Array, half: Array, colour: str, style: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """A band about a line (N,), where it is known."""
    known = np.isfinite(middle) & np.isfinite(half)
    if not known.any():
        return []
    x, middle, half = x[known], middle[known], half[known]
    round_trip = np.concatenate([x, x[::-1]])
    edge = np.concatenate([middle + half, (middle - half)[::-1]])
    own = {"fill": "toself", "fillcolor": pale(colour), "line": {"width": 0}}
    return [line(round_trip, edge, "", {**own, **SILENT, **style})]


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
    plain = {"title": {"text": escape(title), "standoff": 8}, "gridcolor": GRID, "automargin": True}
    return {**plain, "zerolinecolor": "#BBBBBB", "linecolor": "#888888", **changes}


def layout(parts: Mapping[str, Any]) -> dict[str, Any]:
    """Layout of a chart with these axes and changes: fingers scroll the page, the bar zooms."""
    return {
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": "#222222"},
        "margin": {"l": 52, "r": 10, "t": 8, "b": 40},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "dragmode": False,
        "hovermode": "x unified",
        "hoverlabel": {"namelength": 28},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        **parts,
    }


def thinned(count: int, most: int) -> Array:
    """Indices of at most so many of `count` things, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def as_array(values: Sequence[Any]) -> Array:
    """Numbers of a JSON document; infinities stand there as words, gaps as nothing."""
    return np.asarray(values, dtype=float)


FRICTION = {"yaxis": "y2"}  # above the density of speeds
MOST = 161  # velocities of a line
DENSITY = 0.16  # height of the density of speeds, share of the chart
ALWAYS = 3  # curves that are all shown; of more, only the chosen one is at first


def friction_charts(
    section: Section, styles: Mapping[str, Style], chosen: Model | None
) -> list[Chart]:
    """A chart for each joint; none where no model has friction.

    chosen : the model that is shown at first, and with its folds; a click shows others
    """
    models = [m for m in section.of_role("fitted", "given") if np.isfinite(m.curves[-1]).any()]
    first = chosen if chosen in models else next(iter(models), None)
    return [
        _chart(section.description, joint, models, styles, first)
        for joint in range(len(section.description.joints))
        if models
    ]


def _chart(
    data: DataDescription,
    joint: int,
    models: Sequence[Model],
    styles: Mapping[str, Style],
    first: Model | None,
) -> Chart:
    w = data.velocity[:, joint]
    some = thinned(len(w), MOST)
    traces = []
    for i, model in enumerate(sorted(models, key=lambda m: m is not first)):
        shown = len(models) <= ALWAYS or model is first
        group = {
            "legendgroup": f"model {i}",
            "visible": True if shown else "legendonly",
            **FRICTION,
        }
        traces += _curve(model, data, joint, styles[model.label], group, model is first)
    if data.truth is not None:
        drawn = {"color": DARK, "width": 1.6, "dash": "dash"}
        traces.append(line(w[some], data.truth[some, joint], "truth", {"line": drawn, **FRICTION}))
    traces.append(_density(data, joint))
    unit = data.position_units[joint]
    above = {"overlaying": "y", "range": _range(models, data, joint), "hoverformat": ".4g"}
    above["tickmode"] = "auto"  # not those of the hidden axis
    axes = {
        "xaxis": axis(f"velocity [{unit}/s]", {"hoverformat": ".3g", "range": [w[0], w[-1]]}),
        "yaxis": {"range": [0, 1 / DENSITY], "visible": False, "fixedrange": True},
        "yaxis2": axis(f"friction [{data.torque_units[joint]}]", above),
    }
    words = (
        "Friction over velocity: fit to all data with its 95 % band, each fold (thin), "
        "grey: how often each speed occurred. A click on a name shows or hides a model."
    )
    return Chart(data.joints[joint], words, traces, layout(axes), height=320 + 20 * len(models))


def _curve(
    model: Model,
    data: DataDescription,
    joint: int,
    style: Style,
    group: dict[str, Any],
    folds: bool,
) -> list[dict[str, Any]]:
    """Line of a model with its band, and those of its folds where they are wanted."""
    w, overall = data.velocity[:, joint], model.curves[-1, :, joint]
    some = thinned(len(w), MOST)
    traces = []
    for x, middle, half in _band(model, data, joint):
        few = thinned(len(x), MOST)
        traces += band(x[few], middle[few], half[few], style.colour, group)
    thin = {"color": pale(style.colour, 0.4), "width": 0.7}
    for own in model.curves[:-1, some, joint] if folds else ():
        traces.append(line(w[some], own, "", {"line": thin, **SILENT, **group}))
    drawn = {"color": style.colour, "width": 2, "dash": dash(style.line)}
    return [*traces, line(w[some], overall[some], model.name, {"line": drawn, **group})]


def _band(model: Model, data: DataDescription, joint: int) -> list[tuple[Array, Array, Array]]:
    """Velocities, curve and half the width of its 95 % band: by shooting, else by the folds."""
    if model.refined is not None:
        own = band_of(model, data, joint)
        return [(own.velocity, own.curve, own.pointwise)]
    folds = model.curves[:-1, :, joint]
    if model.role != "fitted" or len(folds) < FEWEST:
        return []
    return [(data.velocity[:, joint], model.curves[-1, :, joint], jackknife_width(folds))]


def _range(models: Sequence[Model], data: DataDescription, joint: int) -> list[float]:
    """Ends of the friction axis, with room for the density; one wild fold must not flatten all."""
    curves = [model.curves[:, :, joint].ravel() for model in models]
    curves += [] if data.truth is None else [data.truth[:, joint]]
    high = 1.1 * most([np.abs(own[np.isfinite(own)]) for own in curves])
    return [-high - DENSITY * 2 * high / (1 - DENSITY), high]


def _density(data: DataDescription, joint: int) -> dict[str, Any]:
    """How often each speed occurred, as a grey area at the bottom."""
    w, counts = data.velocity[:, joint], data.density[joint]
    edges = np.linspace(w[0], w[-1], len(counts) + 1)
    # joints rest often: bars taller than nearly all others are cut, or these could not be seen
    full = float(np.quantile(counts, 0.95)) or float(counts.max()) or 1.0
    heights = np.minimum(counts / full, 1.0)
    drawn = {"line": {"width": 0, "shape": "hv"}, "fill": "tozeroy", "fillcolor": PALE}
    own = {"hoverinfo": "skip", **drawn}
    return line(edges, np.append(heights, heights[-1]), "speeds that occurred", own)
