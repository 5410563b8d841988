"""Which speeds occurred: a scatter of the joints' velocities, and a table of their distribution."""

from __future__ import annotations

from typing import Any

from frictionid.arrays import Array
from frictionid.report.figures.style import COLOURS, GREY, figure, plain
from frictionid.report.numbers import percent, short
from frictionid.report.sections import DataDescription
from frictionid.report.tables import Column, Table, line, text_columns


def velocity_scatter(data: DataDescription, w: Array) -> Any:
    """Picture of each joint's velocity (N, n) over the first one's, and how often each occurred."""
    n = w.shape[1]
    units = zip(data.joints, data.position_units, strict=True)
    names = [f"{plain(name)} [{unit}/s]" for name, unit in units]
    picture = figure(2.5, 7.2 if n > 1 else 3.6)
    axes = picture.subplots(1, max(n - 1, 0) + n, squeeze=False)[0]
    for joint in range(1, n):
        axis = axes[joint - 1]
        axis.scatter(
            w[:, 0], w[:, joint], s=2, color=COLOURS[0], alpha=0.35, linewidths=0, rasterized=True
        )
        axis.set_xlabel(names[0])
        axis.set_ylabel(names[joint])
    for joint in range(n):
        axis = axes[n - 1 + joint]
        axis.hist(w[:, joint], 60, color=GREY)
        axis.set_yscale("log")
        axis.set_xlabel(names[joint])
        axis.set_ylabel("samples shown" if joint == 0 else "")
    return picture


def speed_table(dataset: str, data: DataDescription, speeds: Any) -> Table:
    """How fast the joints were: levels that shares of the samples stay below."""
    unit = data.velocity_unit
    columns = [*text_columns("joint"), Column("at rest")]
    columns += [Column(percent(level), "speed below which", unit) for level in speeds["levels"]]
    lines = [
        line([name, percent(own["rest"]), *map(short, own["speeds"]), short(own["reversals"])])
        for name, own in zip(data.joints, speeds["joints"], strict=True)
    ]
    caption = (
        f"{dataset}: speeds of the joints; at rest is below 0.05 {unit}, or 1 % of the speeds of "
        "slower joints."
    )
    heads = (*columns, Column("reversals", "", "1/s"))
    return Table(caption, f"speeds-{dataset}", heads, tuple(lines))
