"""Which speeds occurred: a scatter of the joints' velocities, and a table of their distribution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.report.figures.style import COLOURS, GREY, figure, plain
from frictionid.report.numbers import percent, short
from frictionid.report.tables import Cell, Column, Line, Table


def velocity_scatter(about: Mapping[str, Any]) -> Any:
    """Picture of each joint's velocity over the first one's, beside how often each occurred."""
    w = np.asarray(about["velocities"], dtype=float)
    n, unit = w.shape[1], f"[{about['angle_unit']}/s]"
    names = [plain(name) for name in about["joints"]]
    picture = figure(2.5, 7.2 if n > 1 else 3.6)
    axes = picture.subplots(1, max(n - 1, 0) + n, squeeze=False)[0]
    for joint in range(1, n):
        axis = axes[joint - 1]
        axis.scatter(w[:, 0], w[:, joint], s=2, color=COLOURS[0], alpha=0.35, linewidths=0)
        axis.set_xlabel(f"{names[0]} {unit}")
        axis.set_ylabel(f"{names[joint]} {unit}")
    for joint in range(n):
        axis = axes[n - 1 + joint]
        axis.hist(w[:, joint], 60, color=GREY)
        axis.set_yscale("log")
        axis.set_xlabel(f"{names[joint]} {unit}")
        axis.set_ylabel("samples shown" if joint == 0 else "")
    return picture


def speed_table(dataset: str, about: Mapping[str, Any]) -> Table:
    """How fast the joints were: levels that shares of the samples stay below."""
    levels = about["speeds"]["levels"]
    columns = [Column("joint", words=True), Column("at rest")]
    columns += [
        Column(percent(level), "speed below which", f"{about['angle_unit']}/s") for level in levels
    ]
    columns.append(Column("reversals", "", "1/s"))
    lines = []
    for joint, name in enumerate(about["joints"]):
        own = about["speeds"]["joints"][joint]
        cells = [Cell(str(name)), Cell(percent(own["rest"]))]
        cells += [Cell(short(value)) for value in own["speeds"]]
        cells.append(Cell(short(own["reversals"])))
        lines.append(Line(tuple(cells)))
    caption = f"{dataset}: speeds of the joints; at rest is below 0.05 {about['angle_unit']}/s."
    return Table(caption, f"speeds-{dataset}", tuple(columns), tuple(lines))
