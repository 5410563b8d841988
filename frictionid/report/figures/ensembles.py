"""Friction that is the mean of an ensemble: how far its members differ, and from the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.bands import (
    HATCH,
    LINE,
    SHADE,
    frame,
    measured,
    most,
    off_truth,
    prefixed,
)
from frictionid.report.figures.panels import label, panels, side_by_side
from frictionid.report.figures.style import DARK, GREY, Look, key_above
from frictionid.report.load import Entry, Section
from frictionid.report.numbers import listed, percent

OPACITY = 0.3  # of the band of one standard deviation


def ensembles(section: Section) -> list[Entry]:
    """Entries whose friction is the mean of several members."""
    return [entry for entry in section.entries if entry.members is not None]


def spread(entry: Entry) -> Array | None:
    """Standard deviation (V, n) over the members of an ensemble at each velocity; else None."""
    return None if entry.members is None else entry.members.std(axis=0, ddof=1)


def spread_words(section: Section, about: Mapping[str, Any]) -> str:
    """Sentences of a caption on the shaded bands of ensembles; "" where there is none."""
    own = ensembles(section)
    if not own:
        return ""
    sizes = {e.label: len(e.members) for e in own if e.members is not None}
    told = listed([f"{size} members of {name}" for name, size in sizes.items()])
    words = (
        f" Shaded: one standard deviation over the {told}, to either side of their mean, the fit "
        "to all data. That is how far they differ, with other starts and other recordings held "
        "out, and no interval that was calibrated"
    )
    if about["truth"] is None:
        return f"{words}."
    several = len({entry.recipe for entry in own}) > 1
    inside = [
        f"{percent(held(entry, about))} of the velocities for "
        f"{entry.title if several else entry.label}"
        for entry in own
    ]
    return f"{words}: the truth lies in it at {listed(inside)}."


def held(entry: Entry, about: Mapping[str, Any]) -> float:
    """Share of the velocities and joints at which the truth is within the spread."""
    half = spread(entry)
    assert half is not None
    parts = [off_truth(entry, about, joint) for joint in range(half.shape[1])]
    off = np.stack([part[1] for part in parts if part is not None], axis=-1)
    known = np.isfinite(off)
    return float(np.mean((np.abs(off) <= half)[known]))


def spreads(section: Section, about: Mapping[str, Any], looks: Mapping[str, Look]) -> list[Any]:
    """Pictures of ensembles: curves and, below each, its members about it; a column for each."""
    own = ensembles(section)
    return [_picture(part, own, about, looks) for part in side_by_side(own)]


def _picture(
    shown: Sequence[Entry],
    every: Sequence[Entry],
    about: Mapping[str, Any],
    looks: Mapping[str, Look],
) -> Any:
    picture, axes = panels(len(shown), about, 1.3)
    words = []
    for joint in range(len(about["joints"])):
        w = np.asarray(about["velocity"], dtype=float)[:, joint]
        tall = 1.12 * max(_tall(entry, joint) for entry in every)
        near = max(_near(entry, w, about, joint) for entry in every)
        scale, prefix = prefixed(near)
        words.append(f"about the mean\n[{prefix}{about['torque_unit']}]")
        for c, entry in enumerate(shown):
            look, (above, below) = looks[entry.label], axes[2 * joint : 2 * joint + 2, c]
            frame(above, w, about, joint, tall)
            frame(below, w, about, joint, scale * near)
            _curve(above, entry, w, about, joint, look)
            _members(below, entry, w, about, joint, look, scale)
            below.tick_params(labelleft=c == 0)
    label(picture, axes, shown, every, about, looks, words)
    _key(picture, about, looks[shown[0].label] if len(shown) == 1 else Look(GREY, "-"))
    return picture


def _off(entry: Entry, joint: int) -> Array:
    """Curves (N, V) of the members less their mean."""
    members = np.empty((0, 0, 0)) if entry.members is None else entry.members
    return np.asarray(members[..., joint] - entry.curves[-1][:, joint])


def _tall(entry: Entry, joint: int) -> float:
    """The largest torque of a joint's curve and its band."""
    half = spread(entry)
    assert half is not None
    return most([np.abs(entry.curves[-1][:, joint]) + half[:, joint]])


def _near(entry: Entry, w: Array, about: Mapping[str, Any], joint: int) -> float:
    """End of the axis of what is about the mean, the same for all ensembles."""
    parts = [np.abs(_off(entry, joint))[:, measured(w, about, joint)].ravel()]
    off = off_truth(entry, about, joint)
    if off is not None:
        # a truth far away must not flatten the members
        parts.append(np.minimum(np.abs(off[1]), 4 * most(parts)))
    return 1.12 * most(parts)


def _curve(
    axis: Any, entry: Entry, w: Array, about: Mapping[str, Any], joint: int, look: Look
) -> None:
    mean, half = entry.curves[-1][:, joint], spread(entry)
    assert half is not None
    low, high = mean - half[:, joint], mean + half[:, joint]
    axis.fill_between(w, low, high, color=look.colour, alpha=OPACITY, linewidth=0)
    axis.plot(w, mean, color=look.colour, linewidth=1.2)
    if about["truth"] is not None:
        true = np.asarray(about["truth"], dtype=float)[:, joint]
        axis.plot(w, true, color=DARK, linewidth=1, linestyle=LINE)


def _members(
    axis: Any,
    entry: Entry,
    w: Array,
    about: Mapping[str, Any],
    joint: int,
    look: Look,
    scale: float,
) -> None:
    """Each member less the mean and their spread, in a unit so many times smaller."""
    half = spread(entry)
    assert half is not None
    size = scale * half[:, joint]
    axis.fill_between(w, -size, size, color=look.colour, alpha=OPACITY, linewidth=0)
    axis.plot(w, scale * _off(entry, joint).T, color=look.colour, linewidth=0.6, alpha=0.7)
    axis.axhline(0, color=look.colour, linewidth=1.2)
    off = off_truth(entry, about, joint)
    if off is not None:
        axis.plot(off[0], scale * off[1], color=DARK, linewidth=1, linestyle=LINE)


def _key(picture: Any, about: Mapping[str, Any], look: Look) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color=look.colour, linewidth=1.2),
        Line2D([], [], color=look.colour, linewidth=0.6, alpha=0.7),
        Patch(facecolor=look.colour, alpha=OPACITY, linewidth=0),
    ]
    labels = ["mean, fit to all data", "each member", "± one standard deviation"]
    if _gaps(about):
        handles.append(Patch(facecolor=SHADE, edgecolor=HATCH, hatch="//////", linewidth=0))
        labels.append("not measured")
    if about["truth"] is not None:
        handles.append(Line2D([], [], color=DARK, linewidth=1, linestyle=LINE))
        labels.append("truth")
    key_above(picture, handles, labels)


def _gaps(about: Mapping[str, Any]) -> bool:
    """Whether some velocity of the grid was not measured."""
    grid = np.asarray(about["velocity"], dtype=float)
    return not all(measured(grid[:, j], about, j).all() for j in range(grid.shape[1]))
