"""Picture of designed trajectories: position, velocity and torque over time, with the limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.excitation.trajectory_design import TrajectoryDesign
from frictionid.report.figures.style import (
    COLOURS,
    GRID,
    drawing,
    figure,
    key_above,
    line,
    rendered,
)


def trajectory_picture(design: TrajectoryDesign) -> bytes:
    """PNG of `trajectory_figure`."""
    with drawing():
        return rendered(trajectory_figure(design), ["png"])["png"]


def trajectory_figure(design: TrajectoryDesign) -> Any:
    """Share of its limit that each joint uses, one column for each trajectory."""
    task, many = design.task, len(design.trajectories)
    rows = (
        ("position", "q", "angle"),
        ("velocity", "w", "velocity"),
        ("torque", "torque", "torque"),
    )
    shown = figure(6.5, 1.5 + 4.2 * many)
    axes = shown.subplots(3, many, sharex=True, sharey="row", squeeze=False)
    joints = task.plant.mechanism.joints
    styles = [
        (COLOURS[j % len(COLOURS)], "-" if j < len(COLOURS) else ":") for j in range(len(joints))
    ]
    for row, (label, name, limit) in zip(axes, rows, strict=True):
        row[0].set_ylabel(f"{label} / limit")
        for axis, trajectory in zip(row, design.trajectories, strict=True):
            values = getattr(trajectory, name) / getattr(task.limits, limit)
            for j, (colour, style) in enumerate(styles):
                axis.plot(task.time, values[:, j], color=colour, linestyle=style, linewidth=1)
            for end in (-1.0, 1.0):
                axis.axhline(end, color="0.3", linewidth=0.8, linestyle="--")
            axis.set_yticks(np.linspace(-1.0, 1.0, 5))
            axis.grid(**GRID)
    for number, column in enumerate(axes.T, start=1):
        column[0].set_title(f"trajectory {number}")
        column[-1].set_xlabel("time [s]")
    key_above(shown, {name: line(*style) for name, style in zip(joints, styles, strict=True)})
    return shown
