"""Picture of a designed experiment: torque and expected motion over time, with the limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.excitation.design import Design
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
from frictionid.report.numbers import either


def picture(design: Design) -> bytes:
    """PNG of `design_figure`."""
    with drawing():
        return rendered(design_figure(design), ["png"])["png"]


def design_figure(design: Design) -> Any:
    """Torque, angles and velocities over time, one column for each recording."""
    e = design.experiment
    d = e.plant.mechanism
    rows = {
        f"torque [{either(d.torque_units)}]": (e.commands, design.torque, e.limits.torque),
        f"angle [{either(d.position_units)}]": (e.images, design.motions.q[:, 0], e.limits.angle),
        f"velocity [{either(d.velocity_units)}]": (
            e.images,
            design.motions.w[:, 0],
            e.limits.velocity,
        ),
    }
    shown = figure(6.5, 1.5 + 4.2 * e.recordings)
    axes = shown.subplots(3, e.recordings, sharex=True, sharey="row", squeeze=False)
    for row, (label, (time, values, limit)) in zip(axes, rows.items(), strict=True):
        row[0].set_ylabel(label)
        for r, axis in enumerate(row):
            _curves(axis, time, values[:, r], limit, label.startswith("torque"))
    for r, column in enumerate(axes.T, start=1):
        column[0].set_title(f"recording {r}")
        column[-1].set_xlabel("time [s]")
    key_above(shown, {name: line(colour) for name, colour in _colours(e.plant.n).items()})
    return shown


def _colours(n: int) -> dict[str, str]:
    return {f"joint {j + 1}": COLOURS[j % len(COLOURS)] for j in range(n)}


def _curves(axis: Any, time: Array, values: Array, limit: Array, held: bool) -> None:
    """Curves (T, n) with their limits; a torque is held, and none is shown without a motor."""
    for j, colour in enumerate(_colours(values.shape[1]).values()):
        if held and limit[j] == 0.0:
            continue
        drawstyle = "steps-post" if held else "default"
        axis.plot(time, values[:, j], color=colour, linewidth=1, drawstyle=drawstyle)
        for end in (-limit[j], limit[j]) if np.isfinite(limit[j]) else ():
            axis.axhline(end, color=colour, linewidth=0.8, linestyle="--")
    axis.grid(**GRID)


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
