"""Layout of panels, and what panels of friction over velocity share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.curves import slow_speed
from frictionid.report.figures.style import DARK, DASHED, Style, figure, plain
from frictionid.report.sections import DataDescription, Model

COLUMNS = 3  # fits side by side at most; more go to another picture
ZERO = {"color": "#BBBBBB", "linewidth": 0.5, "zorder": 1}
SHADE, HATCH = "#F0F0F0", "#D4D4D4"

T = TypeVar("T")


def side_by_side(items: Sequence[T], most: int = COLUMNS) -> list[Sequence[T]]:
    """The items of each picture, about as many in one as in another."""
    count = max(-(-len(items) // most), 1)
    ends = [len(items) * i // count for i in range(count + 1)]
    return [items[a:b] for a, b in pairwise(ends) if b > a]


def panel_grid(count: int, most: int, height: float, margin: float) -> tuple[Any, list[Any]]:
    """A figure with so many panels, `most` abreast, their lines so high [inch]; its axes."""
    rows = -(-count // most)
    picture = figure(margin + height * rows)
    axes = picture.subplots(rows, min(count, most), squeeze=False).ravel()
    for spare in axes[count:]:
        spare.set_axis_off()
    return picture, list(axes[:count])


def paired_panels(columns: int, data: DataDescription, ratio: float) -> tuple[Any, Any]:
    """A figure and its axes (2 n, columns); each lower panel is so many times as tall."""
    joints = len(data.joints)
    picture = figure(0.55 + 2.5 * joints)
    heights = {"height_ratios": [1.0, ratio] * joints}
    axes = picture.subplots(2 * joints, columns, squeeze=False, gridspec_kw=heights)
    for c in range(columns):
        for axis in axes[::2, c]:
            axis.tick_params(labelbottom=False, labelleft=c == 0)
    return picture, axes


def label_panels(
    picture: Any,
    axes: Any,
    models: Sequence[Model],
    data: DataDescription,
    styles: Mapping[str, Style],
) -> None:
    """Titles of the columns, and the joints' names at the upper panels."""
    for joint, name in enumerate(data.joints):
        axes[2 * joint, 0].set_ylabel(f"{plain(name)}\n[{data.torque_units[joint]}]")
    for axis, model in zip(axes[0], models, strict=True):
        axis.set_title(plain(model.name), color=styles[model.label].colour, weight="bold")
    picture.align_ylabels(axes[:, 0])
    picture.supxlabel(f"velocity [{data.velocity_unit}]", fontsize=8)


def draw_truth(axis: Any, data: DataDescription, joint: int) -> None:
    """The true friction curve, where it is known."""
    if data.truth is not None:
        true = data.truth[:, joint]
        axis.plot(data.velocity[:, joint], true, color=DARK, linewidth=1, linestyle=DASHED)


def error_to_truth(model: Model, data: DataDescription, joint: int) -> tuple[Array, Array] | None:
    """Velocities (V,) and the true curve less the fitted one, where the truth is known."""
    if data.truth is None:
        return None
    w = data.velocity[:, joint]
    off = data.truth[:, joint] - model.curves[-1][:, joint]
    return w, np.where(np.abs(w) < slow_speed(np.abs(w).max()), np.nan, off)


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


def prefixed(size: float) -> tuple[float, str]:
    """Factor and prefix of the unit in which numbers up to a size are read best.

    >>> prefixed(5.0), prefixed(0.02), prefixed(1e-4)
    ((1.0, ''), (1000.0, 'm'), (1000000.0, 'µ'))
    """
    for scale, prefix in ((1.0, ""), (1e3, "m")):
        if scale * size >= 0.5:
            return scale, prefix
    return 1e6, "µ"


def plain_logarithm(axis: Any) -> None:
    """A logarithmic axis of heights with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axis.set_yscale("log")
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.yaxis.set_minor_formatter(NullFormatter())
