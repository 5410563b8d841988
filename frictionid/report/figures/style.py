"""What pictures share: colours, sizes for a page of two columns, layout of panels, legends."""

import io
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import cycle, pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np

from frictionid.arrays import Array
from frictionid.pictures import COLOURS as COLOURS
from frictionid.pictures import WIDTH as WIDTH
from frictionid.pictures import drawing as drawing
from frictionid.pictures import drawn as drawn
from frictionid.pictures import figure as figure

from ..sections import DataDescription, Model

FORMATS = ("png", "pdf", "svg")
DASHES = ("-", (0, (5, 1.2)), (0, (3, 1, 1, 1)))  # after the last colour, the next kind of line
GREY = "#767676"
LONGEST = 36  # letters of a name
PALE = "#D9D9D9"
DARK = "#222222"
DASHED = (0, (4, 1.5))  # the truth
HALF_PAGE = 5.6  # [inch], of the screen
COLUMNS = 3  # fits side by side at most; more go to another picture
ZERO = {"color": "#BBBBBB", "linewidth": 0.5, "zorder": 1}
SHADE, HATCH = "#F0F0F0", "#D4D4D4"
DENSITY = 0.16  # height of the velocity density, share of a panel

T = TypeVar("T")


class Style(NamedTuple):
    """Colour and kind of line of an identifier, the same in all pictures."""

    colour: str
    line: Any


Styles = Mapping[str, Style]  # by the labels of models
PLAIN = {"none": Style(GREY, "-"), "truth": Style(DARK, DASHED)}  # by roles


def styles(models: Iterable[Model]) -> dict[str, Style]:
    """Style of each identifier by its label: no friction grey, the truth black, others coloured."""
    out: dict[str, Style] = {}
    free = pens()
    for model in models:
        if model.label not in out:
            out[model.label] = PLAIN.get(model.role) or next(free)
    return out


def pens() -> Iterator[Style]:
    """All colours with each kind of line, without end."""
    return (Style(colour, dashes) for dashes in cycle(DASHES) for colour in COLOURS)


def png(draw: Callable[[], Any]) -> bytes:
    """PNG of the figure that a function draws, in our styles."""
    with drawing():
        return rendered(draw(), ["png"])["png"]


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


def mixed(colour: str, tone: float) -> Any:
    """A colour with so much white, or, for negative tones, black."""
    from matplotlib.colors import to_rgb

    base, end = np.array(to_rgb(colour)), 1.0 if tone > 0 else 0.0
    return tuple(base + abs(tone) * (end - base))


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
        c
        for c in range(len(shown), 0, -1)
        if c == 1 or _width(shown, c, handle) < picture.get_figwidth() - 0.1
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


# --- Panels ---------------------------------------------------------------------------------------


def side_by_side(items: Sequence[T], most: int = COLUMNS) -> list[Sequence[T]]:
    """The items of each picture, about as many in one as in another."""
    count = max(-(-len(items) // most), 1)
    ends = [len(items) * i // count for i in range(count + 1)]
    return [items[a:b] for a, b in pairwise(ends) if b > a]


def panel_grid(
    count: int, most: int, height: float, margin: float, width: float = WIDTH
) -> tuple[Any, list[Any]]:
    """A figure with so many panels, `most` abreast, their lines so high [inch]; its axes."""
    rows = -(-count // most)
    picture = figure(margin + height * rows, width)
    axes = picture.subplots(rows, min(count, most), squeeze=False).ravel()
    for spare in axes[count:]:
        spare.set_axis_off()
    return picture, list(axes[:count])


def panels(
    draw: Callable[[Any, int, int], None],
    labels: Sequence[str],
    titles: Sequence[str],
    key: Mapping[str, Any],
    below: str,
    height: float,
    width: float = WIDTH,
    sharex: bool | str = False,
    sharey: bool | str = False,
) -> Any:
    """A figure with a row of panels for each label and a column for each title.

    draw : draws on the axes of a row and a column; key : of `key_above`; below : what the
        horizontal axes are; height : of a row [inch]
    """
    picture = figure(0.6 + height * len(labels), width)
    axes = picture.subplots(len(labels), len(titles), squeeze=False, sharex=sharex, sharey=sharey)
    for (row, column), axis in np.ndenumerate(axes):
        draw(axis, row, column)
    for axis, label in zip(axes[:, 0], labels, strict=True):
        axis.set_ylabel(label)
    for axis, title in zip(axes[0], titles, strict=True):
        axis.set_title(title, fontsize=7, loc="left")
    picture.align_ylabels(axes[:, 0])
    picture.supxlabel(below)
    key_above(picture, key)
    return picture


def model_title(axis: Any, model: Model, styles: Styles) -> None:
    """The model's name in its colour above a panel."""
    axis.set_title(plain(model.name), color=styles[model.label].colour, weight="bold")


def draw_truth(axis: Any, data: DataDescription, joint: int) -> None:
    """The true friction curve, where it is known."""
    if data.truth is not None:
        true = data.truth[:, joint]
        axis.plot(data.velocity[:, joint], true, color=DARK, linewidth=1, linestyle=DASHED)


def truth_key(truth: object) -> dict[str, Any]:
    """Entry of a legend for the true friction, where it is known."""
    return {} if truth is None else {"truth": line(DARK, DASHED, 1)}


def frame(axis: Any, w: Array, data: DataDescription, joint: int, end: float) -> None:
    """Axes of a panel, grey where no velocity was measured."""
    for low, high in _unmeasured(float(w[0]), float(w[-1]), data, joint):
        axis.axvspan(
            low, high, facecolor=SHADE, edgecolor=HATCH, hatch="////", linewidth=0, zorder=0
        )
    velocity_axis(axis, w, (-end, end))


def velocity_axis(axis: Any, w: Array, limits: tuple[float, float]) -> None:
    """Axes of friction over velocities (V,), with lines through zero."""
    axis.axhline(0, **ZERO)
    axis.axvline(0, **ZERO)
    axis.locator_params(nbins=5)
    axis.set_xlim(float(w[0]), float(w[-1]))
    axis.set_ylim(limits)


def unmeasured_patch() -> Any:
    """The area of a legend for velocities that were not measured."""
    from matplotlib.patches import Patch

    return Patch(facecolor=SHADE, edgecolor=HATCH, hatch="//////", linewidth=0)


def unmeasured_key(data: DataDescription) -> dict[str, Any]:
    """Entry of a legend for velocities that were not measured, where there are some."""
    everywhere = all(measured(w, data, j).all() for j, w in enumerate(data.velocity.T))
    return {} if everywhere else {"not measured": unmeasured_patch()}


def measured(velocity: Array, data: DataDescription, joint: int) -> Array:
    """Whether each velocity (V,) was reached by the motion."""
    inside = np.ones(len(velocity), dtype=bool)
    for low, high in _unmeasured(float(velocity[0]), float(velocity[-1]), data, joint):
        inside &= ~((velocity >= low) & (velocity <= high))
    return inside


def _unmeasured(
    begin: float, end: float, data: DataDescription, joint: int
) -> Iterator[tuple[float, float]]:
    """Ranges of velocities that the motion never had: beyond its ends, and empty bins between."""
    low, high = map(float, data.measured[:, joint])
    if begin < low:
        yield begin, min(low, end)
    if high < end:
        yield max(high, begin), end
    counts, grid = data.density[joint], data.velocity[:, joint]
    edges = np.linspace(grid[0], grid[-1], len(counts) + 1)
    for i in np.flatnonzero(counts == 0):
        yield float(edges[i]), float(edges[i + 1])


def most(values: Sequence[Array]) -> float:
    """The largest of values, but for a few; one where there is nothing to show."""
    joined = np.concatenate(values) if values else np.zeros(1)
    joined = joined[np.isfinite(joined)]
    return float(np.quantile(joined, 0.995)) if joined.size and joined.max() > 0 else 1.0


def plain_logarithm(axes: Any, name: str = "y") -> None:
    """A logarithmic axis, of heights or "x", with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axes.set(**{f"{name}scale": "log"})
    axis = getattr(axes, f"{name}axis")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
