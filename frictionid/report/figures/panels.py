"""Pictures with a column for each fit, and for each joint a curve and what is about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from frictionid.report.figures.style import Look, figure, plain
from frictionid.report.load import Entry

COLUMNS = 3  # fits side by side at most; more go to another picture


def side_by_side(entries: Sequence[Entry]) -> list[Sequence[Entry]]:
    """The entries of each picture, about as many in one as in another."""
    count = max(-(-len(entries) // COLUMNS), 1)
    ends = [len(entries) * i // count for i in range(count + 1)]
    return [entries[a:b] for a, b in pairwise(ends) if b > a]


def panels(columns: int, about: Mapping[str, Any], ratio: float) -> tuple[Any, Any]:
    """A figure and its axes (2 n, columns); each lower panel is so many times as tall."""
    joints = len(about["joints"])
    picture = figure(0.55 + 2.5 * joints)
    heights = {"height_ratios": [1.0, ratio] * joints}
    axes = picture.subplots(2 * joints, columns, squeeze=False, gridspec_kw=heights)
    for c in range(columns):
        for axis in axes[::2, c]:
            axis.tick_params(labelbottom=False, labelleft=c == 0)
    return picture, axes


def label(
    picture: Any,
    axes: Any,
    shown: Sequence[Entry],
    every: Sequence[Entry],
    about: Mapping[str, Any],
    looks: Mapping[str, Look],
    below: Sequence[str],
) -> None:
    """Titles of the columns and words at the axes; `below` stands at each joint's lower panels."""
    for joint, words in enumerate(below):
        name = plain(about["joints"][joint])
        axes[2 * joint, 0].set_ylabel(f"{name}\n[{about['torque_unit']}]")
        axes[2 * joint + 1, 0].set_ylabel(words)
    recipes = {entry.recipe for entry in every}
    for axis, entry in zip(axes[0], shown, strict=True):
        beside = f", {entry.recipe}" if len(recipes) > 1 else ""
        colour = looks[entry.label].colour
        axis.set_title(plain(f"{entry.label}{beside}"), color=colour, weight="bold")
    picture.align_ylabels(axes[:, 0])
    picture.supxlabel(f"velocity [{about['angle_unit']}/s]", fontsize=8)
