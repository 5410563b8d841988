"""Charts of the page: what Plotly draws on the screen, as plain documents of data and layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array

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
    """The library that draws charts, compressed; it comes with the Python package."""
    import gzip

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
