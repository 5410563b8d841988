"""Picture of a design: torque and expected motion over time, with the limits."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.figure import Figure

from frictionid.arrays import Array
from frictionid.excitation.design import Design


def picture(design: Design) -> bytes:
    """PNG of torque, angles and velocities, one column for each recording."""
    e = design.experiment
    d = e.plant.mechanism.description
    figure = Figure(figsize=(1.5 + 4.2 * e.recordings, 6.5), layout="constrained")
    axes = figure.subplots(3, e.recordings, sharex=True, sharey="row", squeeze=False)
    rows = (
        (f"torque [{d.torque_unit}]", e.commands, design.torque, e.limits.torque),
        (f"angle [{d.angle_unit}]", e.images, design.motions.q[:, 0], e.limits.angle),
        (f"velocity [{d.angle_unit}/s]", e.images, design.motions.w[:, 0], e.limits.velocity),
    )
    for row, (label, time, values, limit) in zip(axes, rows, strict=True):
        row[0].set_ylabel(label)
        for r, ax in enumerate(row):
            _curves(ax, time, values[:, r], limit, held=label.startswith("torque"))
    for r, ax in enumerate(axes[0], start=1):
        ax.set_title(f"recording {r}")
        axes[-1][r - 1].set_xlabel("time [s]")
    axes[1][-1].legend(loc="upper right", fontsize="small")
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()


def _curves(ax, time: Array, values: Array, limit: Array, *, held: bool) -> None:  # type: ignore[no-untyped-def]
    for j in range(values.shape[1]):
        if held and limit[j] == 0.0:
            continue
        style = "steps-post" if held else "default"
        ax.plot(time, values[:, j], color=f"C{j}", lw=1, drawstyle=style, label=f"joint {j + 1}")
        if np.isfinite(limit[j]):
            for side in (-limit[j], limit[j]):
                ax.axhline(side, color=f"C{j}", lw=0.8, ls="--")
    ax.grid(alpha=0.3)
