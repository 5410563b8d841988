"""Friction curves found by shooting, with their bands, and grey where nothing was measured."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.panels import label, panels, side_by_side
from frictionid.report.figures.style import DARK, GREY, Look, key_above
from frictionid.report.load import Entry

SHADE, HATCH = "#F0F0F0", "#D4D4D4"
LINE = (0, (4, 1.5))
SLOW = 0.1  # [rad/s]: below it the smoothing of the sign would be compared, not friction
STRONG, WEAK = 0.5, 0.22  # opacity of the pointwise and the simultaneous band


class Band(NamedTuple):
    """Curve (V,) of a joint at velocities (V,), with half-widths (V,)."""

    velocity: Array
    curve: Array
    pointwise: Array
    simultaneous: Array


def curve_bands(
    fits: Sequence[Entry], about: Mapping[str, Any], looks: Mapping[str, Look]
) -> list[Any]:
    """Pictures of curves and, below each, of the bands about it: a column for each fit."""
    return [_picture(part, fits, about, looks) for part in side_by_side(fits)]


def _picture(
    shown: Sequence[Entry],
    every: Sequence[Entry],
    about: Mapping[str, Any],
    looks: Mapping[str, Look],
) -> Any:
    picture, axes = panels(len(shown), about, 1 / 1.5)
    words = []
    for joint in range(len(about["joints"])):
        bands = {entry: _band(entry, about, joint) for entry in every}
        tall = _tall(bands.values())
        near = {entry: _near(entry, bands[entry], about, joint) for entry in every}
        scale, prefix = prefixed(max(near.values()))
        words.append(f"about the fit\n[{prefix}{about['torque_unit']}]")
        for c, entry in enumerate(shown):
            pair = axes[2 * joint : 2 * joint + 2, c]
            for axis, limit in zip(pair, (tall, near[entry]), strict=True):
                frame(axis, bands[entry].velocity, about, joint, limit)
            _curve(pair[0], bands[entry], about, joint, looks[entry.label])
            _about_zero(pair[1], entry, bands[entry], about, joint, looks[entry.label], scale)
    label(picture, axes, shown, every, about, looks, words)
    _key(picture, about)
    return picture


def prefixed(size: float) -> tuple[float, str]:
    """Factor and prefix of the unit in which numbers up to a size are read best.

    >>> prefixed(5.0), prefixed(0.02), prefixed(1e-4)
    ((1.0, ''), (1000.0, 'm'), (1000000.0, 'µ'))
    """
    for scale, prefix in ((1.0, ""), (1e3, "m")):
        if scale * size >= 0.5:
            return scale, prefix
    return 1e6, "µ"


def _band(entry: Entry, about: Mapping[str, Any], joint: int) -> Band:
    """A joint's band; documents without velocities of their own have it on the curves' grid."""
    own = (entry.refined or {})["bands"]
    velocity = own.get("velocity", about["velocity"])
    curve = own.get("curve", entry.curves[-1])
    parts = (velocity, curve, own["pointwise"], own["simultaneous"])
    return Band(*(np.asarray(part, dtype=float)[:, joint] for part in parts))


def _tall(bands: Iterable[Band]) -> float:
    """End of the axis of a joint's curves, the same for all fits."""
    return 1.12 * most([np.abs(band.curve) for band in bands])


def _near(entry: Entry, band: Band, about: Mapping[str, Any], joint: int) -> float:
    """End of the axis of what is about a curve: each fit has its own, to show its bands."""
    inside = band.simultaneous[measured(band.velocity, about, joint)]
    parts = [inside]
    off = off_truth(entry, about, joint)
    if off is not None:
        # a truth far away must not flatten the bands
        parts.append(np.minimum(np.abs(off[1]), 4 * most(parts)))
    return 1.12 * most(parts)


def most(values: Sequence[Array]) -> float:
    """The largest of values, but for a few; one where there is nothing to show."""
    joined = np.concatenate(values) if values else np.zeros(1)
    joined = joined[np.isfinite(joined)]
    return float(np.quantile(joined, 0.995)) if joined.size and joined.max() > 0 else 1.0


def measured(velocity: Array, about: Mapping[str, Any], joint: int) -> Array:
    """Whether each velocity (V,) was reached by the motion."""
    inside = np.ones(len(velocity), dtype=bool)
    for low, high in _unmeasured(float(velocity[0]), float(velocity[-1]), about, joint):
        inside &= ~((velocity >= low) & (velocity <= high))
    return inside


def _unmeasured(
    begin: float, end: float, about: Mapping[str, Any], joint: int
) -> Iterator[tuple[float, float]]:
    """Ranges of velocities that the motion never had: beyond its ends, and empty bins between."""
    grid = np.asarray(about["velocity"], dtype=float)[:, joint]
    low, high = grid[0], grid[-1]
    if "measured" in about:
        low, high = (float(ends[joint]) for ends in about["measured"])
    if begin < low:
        yield begin, min(low, end)
    if high < end:
        yield max(high, begin), end
    counts = np.asarray(about["density"], dtype=float)[joint]
    edges = np.linspace(grid[0], grid[-1], len(counts) + 1)
    for i in np.flatnonzero(counts == 0):
        yield float(edges[i]), float(edges[i + 1])


def frame(axis: Any, w: Array, about: Mapping[str, Any], joint: int, end: float) -> None:
    """Axes of a panel, grey where no velocity was measured."""
    for low, high in _unmeasured(float(w[0]), float(w[-1]), about, joint):
        axis.axvspan(
            low, high, facecolor=SHADE, edgecolor=HATCH, hatch="////", linewidth=0, zorder=0
        )
    axis.axhline(0, color="#BBBBBB", linewidth=0.5, zorder=1)
    axis.axvline(0, color="#BBBBBB", linewidth=0.5, zorder=1)
    axis.locator_params(nbins=5)
    axis.set_xlim(float(w[0]), float(w[-1]))
    axis.set_ylim(-end, end)


def _curve(axis: Any, band: Band, about: Mapping[str, Any], joint: int, look: Look) -> None:
    _fill(axis, band, band.curve, look)
    axis.plot(band.velocity, band.curve, color=look.colour, linewidth=1.2)
    if about["truth"] is not None:
        w = np.asarray(about["velocity"], dtype=float)[:, joint]
        true = np.asarray(about["truth"], dtype=float)[:, joint]
        axis.plot(w, true, color=DARK, linewidth=1, linestyle=LINE)


def _about_zero(
    axis: Any,
    entry: Entry,
    band: Band,
    about: Mapping[str, Any],
    joint: int,
    look: Look,
    scale: float,
) -> None:
    """The bands in a unit so many times smaller, with the truth where it is known."""
    small = Band(band.velocity, *(scale * part for part in band[1:]))
    _fill(axis, small, 0.0 * small.curve, look)
    low, high = axis.get_ylim()
    axis.set_ylim(scale * low, scale * high)
    axis.axhline(0, color=look.colour, linewidth=1.2)
    off = off_truth(entry, about, joint)
    if off is not None:
        axis.plot(off[0], scale * off[1], color=DARK, linewidth=1, linestyle=LINE)


def _fill(axis: Any, band: Band, middle: Array, look: Look) -> None:
    for half, alpha in ((band.simultaneous, WEAK), (band.pointwise, STRONG)):
        low, high = middle - half, middle + half
        axis.fill_between(band.velocity, low, high, color=look.colour, alpha=alpha, linewidth=0)


def off_truth(entry: Entry, about: Mapping[str, Any], joint: int) -> tuple[Array, Array] | None:
    """Velocities (V,) and the true curve less the fitted one, where the truth is known."""
    if about["truth"] is None:
        return None
    w = np.asarray(about["velocity"], dtype=float)[:, joint]
    off = np.asarray(about["truth"], dtype=float)[:, joint] - entry.curves[-1][:, joint]
    return w, np.where(np.abs(w) < SLOW, np.nan, off)


def _key(picture: Any, about: Mapping[str, Any]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color=GREY, linewidth=1.2),
        Patch(facecolor=GREY, alpha=STRONG + WEAK / 2, linewidth=0),
        Patch(facecolor=GREY, alpha=WEAK, linewidth=0),
        Patch(facecolor=SHADE, edgecolor=HATCH, hatch="//////", linewidth=0),
    ]
    labels = ["fit to all data", "95 % at each velocity", "95 % at all velocities", "not measured"]
    if about["truth"] is not None:
        handles.append(Line2D([], [], color=DARK, linewidth=1, linestyle=LINE))
        labels.append("truth")
    key_above(picture, handles, labels)
