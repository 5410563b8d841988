"""Box plots of the one-step losses over the folds, with the truth's own score as a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import DARK, Look, figure, plain
from frictionid.report.load import Entry, Key, Section
from frictionid.report.numbers import INFINITE, short
from frictionid.report.scoreboard import ONE_STEP


def one_step_boxes(section: Section, looks: Mapping[str, Look], unit: str) -> Any:
    """Losses of the held-out folds: a box for each identifier and recipe, a panel for each loss."""
    entries = section.of_role("none", "fitted", "given")
    places, several = _places(entries), len(section.recipes) > 1
    picture = figure(0.75 + 0.24 * float(places[-1] if len(places) else 0) + 0.24)
    axes = picture.subplots(1, len(ONE_STEP), sharey=True, squeeze=False)[0]
    for axis, (score, statistic) in zip(axes, ONE_STEP, strict=True):
        key = Key(score, statistic)
        for entry, place in zip(entries, places, strict=True):
            losses = entry.scores[section.dataset].folds(key)
            hollow = several and entry.recipe == section.recipes[0]
            _box(axis, losses, place, looks[entry.label], hollow)
        _truth(axis, section, key)
        scheme = score.removeprefix("one_step_")
        axis.set_xlabel(f"one-step loss, {scheme} ({statistic}) [{unit}/s]")
        axis.grid(axis="x", color="#EEEEEE", linewidth=0.6)
        axis.set_axisbelow(True)
    names = [plain(entry.title if several else entry.label) for entry in entries]
    axes[0].set_yticks(places, names)
    axes[0].set_ylim(float(max(places, default=0)) + 0.7, -0.7)
    for axis in axes:
        axis.tick_params(axis="y", length=0)
    return picture


def _places(entries: Sequence[Entry]) -> list[float]:
    """Height of each box: recipes of an identifier side by side, a gap between identifiers."""
    order = {name: i for i, name in enumerate(dict.fromkeys(e.label for e in entries))}
    counts = {name: sum(e.label == name for e in entries) for name in order}
    first, at = {}, 0.0
    for name in order:
        first[name] = at
        at += 0.8 * counts[name] + 0.45
    seen: dict[str, int] = {}
    out = []
    for entry in entries:
        seen[entry.label] = seen.get(entry.label, -1) + 1
        out.append(first[entry.label] + 0.8 * seen[entry.label])
    return out


def _box(axis: Any, losses: Array, place: float, look: Look, hollow: bool) -> None:
    """Quartiles, range and mean of a box, and the folds as dots; `hollow` tells recipes apart."""
    finite = losses[np.isfinite(losses)]
    lost = len(losses) - len(finite)
    if lost:
        words = f"{INFINITE} in {lost} of {len(losses)} folds "
        axis.annotate(
            words, (1, place), xycoords=("axes fraction", "data"), ha="right", va="center"
        )
    if not len(finite):
        return
    edge = {"color": look.colour, "linewidth": 0.9}
    axis.boxplot(
        [finite],
        positions=[place],
        orientation="horizontal",
        widths=0.56,
        whis=(0, 100),
        manage_ticks=False,
        patch_artist=True,
        boxprops={
            "facecolor": "white" if hollow else _tint(look.colour, 0.3),
            "edgecolor": look.colour,
            "linewidth": 0.9,
        },
        medianprops={"color": look.colour, "linewidth": 1.8},
        whiskerprops=edge,
        capprops=edge,
    )
    height = place + 0.16 * np.where(np.arange(len(finite)) % 2, 1, -1)
    axis.plot(finite, height, "o", markersize=1.8, color=look.colour, alpha=0.7, markeredgewidth=0)
    axis.plot(
        [finite.mean()], [place], "D", markersize=3, color="white", markeredgecolor=DARK, zorder=4
    )


def _tint(colour: str, strength: float) -> Any:
    from matplotlib.colors import to_rgb

    return tuple(1 - strength * (1 - part) for part in to_rgb(colour))


def _truth(axis: Any, section: Section, key: Key) -> None:
    for entry in section.of_role("truth"):
        losses = entry.scores[section.dataset].folds(key)
        if len(losses) and np.isfinite(losses).all():
            mean = float(losses.mean())
            axis.axvline(mean, color=DARK, linewidth=1, linestyle=(0, (4, 1.5)), zorder=1)
            axis.annotate(
                f"truth {short(mean, 3)}",
                (mean, 1),
                xycoords=("data", "axes fraction"),
                xytext=(0, 1),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=7,
                color=DARK,
            )
