"""Common style of the pictures: a colour for each identifier, sizes for a page of two columns."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

from frictionid.report.sections import Model

WIDTH = 7.2  # [inch], both columns of a journal's page
FORMATS = ("png", "pdf", "svg")
# Okabe and Ito's colours, distinct with any colour vision; without yellow, too pale on white
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = ("-", (0, (5, 1.2)), (0, (3, 1, 1, 1)))  # after the last colour, the next kind of line
GREY = "#767676"
LONGEST = 36  # letters of a name
PALE = "#D9D9D9"
DARK = "#222222"
DASHED = (0, (4, 1.5))  # the truth
GRID = {"color": "#EEEEEE", "linewidth": 0.6}


class Style(NamedTuple):
    """Colour and kind of line of an identifier, the same in all pictures."""

    colour: str
    line: Any


def styles(models: Iterable[Model]) -> dict[str, Style]:
    """Style of each identifier by its label: no friction grey, the truth black, others coloured."""
    out: dict[str, Style] = {}
    coloured = 0
    for model in models:
        if model.label in out:
            continue
        if model.role in ("none", "truth"):
            dark = model.role == "truth"
            out[model.label] = Style(DARK if dark else GREY, DASHED if dark else "-")
            continue
        repeat, place = divmod(coloured, len(COLOURS))
        out[model.label] = Style(COLOURS[place], DASHES[repeat % len(DASHES)])
        coloured += 1
    return out


def drawing() -> AbstractContextManager[Any]:
    """A context in which pictures have our styles, whatever the user's settings; these stay."""
    import matplotlib.style

    settings: Mapping[str, Any] = {
        "font.size": 8,
        "axes.titlesize": 8,
        "axes.labelsize": 8,
        "xtick.labelsize": 7,
        "ytick.labelsize": 7,
        "legend.fontsize": 7.5,
        "legend.frameon": False,
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "lines.linewidth": 1.2,
        "savefig.dpi": 200,
        "pdf.fonttype": 42,
        "svg.hashsalt": "frictionid",
    }
    return matplotlib.style.context(["default", dict(settings)])


def figure(height: float, width: float = WIDTH) -> Any:
    """An empty figure as wide as a page, sizes in inches."""
    from frictionid.report.figures.notebook_figure import NotebookFigure

    return NotebookFigure(figsize=(width, height), layout="constrained")


def drawn(draw: Callable[[], Any]) -> Any:
    """The figure that a function draws, in our styles; later settings do not change it."""
    with drawing():
        picture = draw()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=r"Glyph .* missing")
            picture.draw_without_rendering()  # ticks are made here, in the styles of this moment
    return picture


def rendered(picture: Any, kinds: Iterable[str] = FORMATS) -> dict[str, bytes]:
    """A figure's files by their endings, without dates: the same picture has the same bytes."""
    nothing = {
        "png": {"Software": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
        "svg": {"Date": None, "Creator": None},
    }
    out = {}
    with warnings.catch_warnings():
        # names may hold characters that the font lacks: they become boxes
        warnings.filterwarnings("ignore", message=r"Glyph .* missing")
        if (layout := picture.get_layout_engine()) is not None:
            layout.execute(picture)
            picture.set_layout_engine(None)  # else each format would draw twice
        for kind in kinds:
            stream = io.BytesIO()
            picture.savefig(stream, format=kind, metadata=nothing[kind])
            content = stream.getvalue()
            out[kind] = compact(content) if kind == "svg" else content
    return out


def compact(svg: bytes) -> bytes:
    """An SVG whose paths have two decimals of a point, and nothing between tags.

    >>> compact(b'<path d="M 1.2345 2 L 3.123456 4"/>')
    b'<path d="M 1.23 2 L 3.12 4"/>'
    """
    svg = re.sub(rb' d="[^"]*"', lambda d: re.sub(rb"(\.\d\d)\d+|\n", rb"\1", d[0]), svg)
    return re.sub(rb">\s+<", b"><", svg)


def plain(name: str) -> str:
    r"""A name that is drawn as it stands: no mathematics, no end of a line, shortened if long.

    >>> print(plain("a$b_c"))
    a\$b_c
    """
    words = " ".join(name.split())
    if len(words) > LONGEST:
        words = f"{words[: LONGEST // 2]}…{words[-LONGEST // 2 + 1 :]}"
    return words.replace("$", r"\$")


def line(color: Any, linestyle: Any = "-", linewidth: float = 1.2, alpha: float = 1.0) -> Any:
    """A line for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=color, linestyle=linestyle, linewidth=linewidth, alpha=alpha)


def marker(color: Any, kind: str = "o", size: float = 4, face: Any = None) -> Any:
    """A marker for a legend; face : its inner colour, where it is another one."""
    from matplotlib.lines import Line2D

    face = color if face is None else face
    return Line2D([], [], color=color, marker=kind, markersize=size, linestyle="", mfc=face)


def patch(color: Any, alpha: float = 1.0) -> Any:
    """An area for a legend."""
    from matplotlib.patches import Patch

    return Patch(facecolor=color, alpha=alpha, linewidth=0)


def key_above(picture: Any, key: Mapping[str, Any], handle: float = 1.8) -> None:
    """A legend above all panels, read line by line, in as many lines as its words need.

    key : handles by their labels; handle : length of their lines, in letters
    """
    handles, labels = list(key.values()), list(map(plain, key))
    # a label that begins with _ would be left out
    shown = [f" {label}" if label.startswith("_") else label for label in labels]
    columns = next(
        c for c in range(len(shown), 0, -1) if c == 1 or _width(shown, c, handle) < WIDTH - 0.1
    )
    order = [i for column in range(columns) for i in range(column, len(shown), columns)]
    picture.legend(
        [handles[i] for i in order],
        [shown[i] for i in order],
        loc="outside upper center",
        ncols=columns,
        handlelength=handle,
        handletextpad=0.5,
        columnspacing=1.2,
    )


def _width(labels: list[str], columns: int, handle: float) -> float:
    """Estimated width of a legend [inch]: line, gaps, and letters of 7.5 points."""
    widest = [max(map(len, labels[column::columns])) for column in range(columns)]
    return sum(0.18 + 0.104 * handle + 0.061 * letters for letters in widest)
