"""Designed trajectories: as text, as a document, and as tables that a controller can follow."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from frictionid.excitation.trajectory_design import TrajectoryDesign
from frictionid.report.render import render
from frictionid.report.tables import Column, Table, line, terminal_text, text_columns

_DECIMALS = 9


def trajectory_csv(design: TrajectoryDesign, number: int, rate: float) -> str:
    """CSV text of one period at so many samples per second [Hz].

    Columns: time [s], then position, velocity and acceleration of each joint, q1 w1 a1 q2 ..., SI.
    """
    references = design.trajectories[number].references
    time = np.arange(round(design.task.length * rate) + 1) / rate
    columns = [part for reference in references for part in reference.motion(time)]
    heads = [f"{name}{j + 1}" for j in range(len(references)) for name in "qwa"]
    lines = [",".join(["time", *heads])]
    for t, row in zip(time, np.stack(columns, axis=-1), strict=True):
        lines.append(f"{t:.9g}," + ",".join(f"{v + 0.0:.{_DECIMALS}f}" for v in row))
    return "\n".join(lines) + "\n"


def trajectory_text(design: TrajectoryDesign) -> str:
    """The motion against the limits, and the expected standard errors of friction."""
    context = {
        "task": design.task,
        "table": terminal_text(trajectory_table(design)),
        "unsure": [design.task.plant.mechanism.joints[j] for j in design.unsure],
    }
    return render("trajectory_design.j2", context, markup=False).rstrip("\n")


def trajectory_table(design: TrajectoryDesign) -> Table:
    """Largest position, velocity and torque of each joint, and the errors of its friction."""
    task, mechanism = design.task, design.task.plant.mechanism
    largest = {
        name: np.max([np.abs(getattr(t, name)).max(axis=0) for t in design.trajectories], axis=0)
        for name in ("q", "w", "torque")
    }
    columns = [
        *text_columns("joint"),
        *(
            Column(head, group)
            for group in ("position", "velocity", "torque")
            for head in ("largest", "limit")
        ),
        *(Column(name, "std error [%]") for name in task.friction.law.names),
    ]
    limits = (task.limits.angle, task.limits.velocity, task.limits.torque)
    lines = []
    for j, joint in enumerate(mechanism.joints):
        cells = [joint]
        for own, limit in zip(largest.values(), limits, strict=True):
            cells += [f"{own[j]:.3g}", f"{limit[j]:.3g}"]
        lines.append(line([*cells, *(f"{100 * e:.2g}" for e in design.error[j])]))
    return Table("", "trajectories", tuple(columns), tuple(lines))


def trajectory_document(design: TrajectoryDesign) -> dict[str, Any]:
    """Coefficients, as `references` of a rig.toml has them, and expected errors; SI units."""
    return {
        "length": design.task.length,
        "trajectories": [
            {"references": [asdict(own) for own in trajectory.references]}
            for trajectory in design.trajectories
        ],
        "joints": [
            {
                "joint": joint,
                **{
                    f"{name}_relative_error": float(error)
                    for name, error in zip(design.task.friction.law.names, errors, strict=True)
                },
                "unsure": j in design.unsure,
            }
            for j, (joint, errors) in enumerate(
                zip(design.task.plant.mechanism.joints, design.error, strict=True)
            )
        ],
    }
