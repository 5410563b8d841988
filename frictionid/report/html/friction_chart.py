"""Friction over velocity on the screen: every model with its band, the truth, the speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.example_motions import FEWEST, jackknife_width
from frictionid.report.figures.ensembles import band_of
from frictionid.report.figures.panels import most
from frictionid.report.figures.style import DARK, PALE, Style
from frictionid.report.html.charts import (
    SILENT,
    Chart,
    axis,
    band,
    dash,
    layout,
    line,
    pale,
    thinned,
)
from frictionid.report.sections import DataDescription, Model, Section

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
