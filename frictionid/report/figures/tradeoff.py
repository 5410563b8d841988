"""Whether a lower one-step loss comes with a better prediction, and with a truer friction curve."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from frictionid.report.figures.style import DARK, Look, figure, key_above, plain
from frictionid.report.load import Entry, Key, Section
from frictionid.report.numbers import coordinate
from frictionid.report.paired import level

LOSS = Key("one_step_euler", "mean")


def loss_against(
    section: Section, horizon: float, about: Mapping[str, Any], looks: Mapping[str, Look]
) -> Any:
    """Rollout error and curve error over one-step loss, a point for each model."""
    dataset, unit = section.dataset, about["angle_unit"]
    rollout = Key("rollout_angle", "median", horizon)
    joints = [str(j + 1) for j in range(len(about["joints"]))]
    words = f"{coordinate(unit)} error after {horizon:g} s [{unit}]"
    panels: list[tuple[str, Callable[[Entry], float]]] = [
        (words, lambda e: level(e, dataset, rollout)),
        ("curve error, mean of joints [%]", lambda e: _curve(e, dataset, joints)),
    ]
    names = list(looks)
    picture = figure(2.7)
    for axis, (words, height) in zip(picture.subplots(1, 2), panels, strict=True):
        for entry in section.entries:
            # points on the same spot become rings around each other
            size = max(10 - 1.5 * names.index(entry.label), 4.0)
            _point(axis, section, entry, height(entry), looks[entry.label], size)
        axis.set_yscale("log")
        axis.set_xlabel(f"one-step loss, euler [{unit}/s]")
        axis.set_ylabel(words)
        axis.grid(color="#EEEEEE", linewidth=0.6)
        _ticks(axis)
    _key(picture, section, looks)
    return picture


def _curve(entry: Entry, dataset: str, joints: list[str]) -> float:
    if entry.role == "truth":
        return float("nan")
    scores = entry.scores[dataset]
    return 100 * float(np.mean([scores[Key("curve_error", "rms", joint=j)] for j in joints]))


def _point(
    axis: Any, section: Section, entry: Entry, height: float, look: Look, size: float
) -> None:
    loss = level(entry, section.dataset, LOSS)
    if entry.role == "truth" and np.isfinite(loss):
        axis.axvline(loss, color=DARK, linewidth=1, linestyle=(0, (4, 1.5)), zorder=1)
    if not np.isfinite([loss, height]).all() or height <= 0:
        return
    hollow = len(section.recipes) > 1 and entry.recipe == section.recipes[0]
    axis.plot(
        loss,
        height,
        {"none": "s", "given": "D", "truth": "*"}.get(entry.role, "o"),
        color=look.colour,
        markerfacecolor="white" if hollow else look.colour,
        markeredgewidth=1.3,
        markersize={"none": 6, "truth": 9}.get(entry.role, size),
    )


def _ticks(axis: Any) -> None:
    """Plain numbers on the logarithmic axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _key(picture: Any, section: Section, looks: Mapping[str, Look]) -> None:
    from matplotlib.lines import Line2D

    markers = {"none": "s", "given": "D", "truth": "*"}
    roles = {entry.label: entry.role for entry in section.entries}
    handles = [
        Line2D(
            [], [], color=looks[n].colour, marker=markers.get(r, "o"), linestyle="", markersize=5
        )
        for n, r in roles.items()
    ]
    labels = list(roles)
    if len(section.recipes) > 1:
        first, *others = section.recipes
        words = (f"{first} recipe", f"{' and '.join(others)} recipe")
        for fill, label in zip(("white", "black"), words, strict=True):
            handles.append(
                Line2D([], [], color="black", marker="o", linestyle="", markerfacecolor=fill)
            )
            labels.append(plain(label))
    key_above(picture, handles, labels, 0.8)
