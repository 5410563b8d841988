"""Pictures of a verdict: where the joints have been, what moved them, friction before any fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from frictionid.check import Verdict
from frictionid.mechanics import mechanism_of
from frictionid.report.files import write_bytes

BLUE, ORANGE, GREEN, GREY, PALE = "#0072B2", "#D55E00", "#009E73", "#767676", "#D9D9D9"
LOOKS = {
    "font.size": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
    "savefig.dpi": 200,
}
RECORDINGS = 3  # shown over time


def write_pictures(verdict: Verdict, folder: Path) -> list[Path]:
    """Paths of the pictures written: coverage, motion and residual torque (PNG)."""
    import io

    import matplotlib.style
    from matplotlib.figure import Figure

    made = []
    with matplotlib.style.context(["default", LOOKS]):
        for name, draw in (("coverage", _coverage), ("motion", _motion), ("residual", _residual)):
            figure = Figure(layout="constrained")
            draw(verdict, figure)
            stream = io.BytesIO()
            figure.savefig(stream, format="png", metadata={"Software": None})
            path = folder / f"{name}.png"
            write_bytes(path, stream.getvalue())
            made.append(path)
    return made


def _units(verdict: Verdict) -> tuple[str, str]:
    description = mechanism_of(verdict.evidence.dataset.mechanism).description
    return description.angle_unit, description.torque_unit


def _coverage(verdict: Verdict, figure: Any) -> None:
    """The (q, w) plane of each joint, rest marked."""
    n, (unit, _) = len(verdict.joints), _units(verdict)
    figure.set_size_inches(3.6 * n, 3.0)
    states = [m.states for m in verdict.evidence.motions]
    q, w = np.concatenate([s.q for s in states]), np.concatenate([s.w for s in states])
    for j, axes in enumerate(np.atleast_1d(figure.subplots(1, n))):
        fact = verdict.joints[j]
        rest = np.abs(w[:, j]) < fact.rest_speed
        size = float(np.clip(2e4 / len(q), 0.3, 4.0))
        axes.scatter(q[~rest, j], w[~rest, j], s=size, color=BLUE, linewidths=0, rasterized=True)
        axes.scatter(q[rest, j], w[rest, j], s=size, color=ORANGE, linewidths=0, rasterized=True)
        axes.axhline(0.0, color=PALE, linewidth=0.6, zorder=0)
        axes.set_title(f"joint {j + 1}: {100 * fact.rest:.0f} % of the time at rest (orange)")
        axes.set_xlabel(f"q{j + 1} [{unit}]")
        axes.set_ylabel(f"w{j + 1} [{unit}/s]")


def _motion(verdict: Verdict, figure: Any) -> None:
    """Angles, velocities and torques over time, of the recordings that move most."""
    evidence, (unit, torque_unit) = verdict.evidence, _units(verdict)
    dataset = evidence.dataset
    chosen = _chosen(verdict)
    figure.set_size_inches(7.2, 4.6)
    rows = figure.subplots(3, len(chosen), sharex="col", sharey="row", squeeze=False)
    colours = (BLUE, ORANGE, GREEN)
    for column, i in enumerate(chosen):
        recording, states = dataset.recordings[i], evidence.motions[i].states
        start = states.time[0]
        for j in range(states.q.shape[1]):
            colour = colours[j % len(colours)]
            rows[0][column].plot(states.time - start, states.q[:, j], color=colour)
            rows[1][column].plot(states.time - start, states.w[:, j], color=colour)
            held = "post" if recording.torque.hold == "previous" else "default"
            rows[2][column].plot(
                recording.torque.time - start,
                recording.torque.value[:, j],
                color=colour,
                drawstyle={"post": "steps-post", "default": "default"}[held],
                linewidth=0.7,
            )
        rows[0][column].set_title(_short(recording.name))
        rows[2][column].set_xlabel("time [s]")
        rows[2][column].set_xlim(0.0, states.time[-1] - start)
    for axes, label in zip(
        rows[:, 0],
        (f"angle [{unit}]", f"velocity [{unit}/s]", f"torque [{torque_unit}]"),
        strict=True,
    ):
        axes.set_ylabel(label)
    names = [f"joint {j + 1}" for j in range(len(verdict.joints))]
    figure.legend(rows[0][0].lines, names, loc="outside upper right", ncols=len(names))


def _chosen(verdict: Verdict) -> list[int]:
    """Recordings to show: those in which all joints together are fastest, in their own order."""
    speed = [np.sqrt(np.mean(m.states.w**2)) for m in verdict.evidence.motions]
    return sorted(np.argsort(speed)[::-1][:RECORDINGS].tolist())


def _short(name: str) -> str:
    name = name.rsplit("/", 1)[-1].replace("$", r"\$")
    return name if len(name) <= 28 else f"{name[:13]}…{name[-13:]}"


def _residual(verdict: Verdict, figure: Any) -> None:
    """Torque that the told mechanism leaves to friction, against velocity, and least squares."""
    rows, estimate = verdict.evidence.rows, verdict.estimate
    n, (unit, torque_unit) = len(verdict.joints), _units(verdict)
    figure.set_size_inches(3.6 * n, 3.0)
    nb = len(verdict.told)
    for j, axes in enumerate(np.atleast_1d(figure.subplots(1, n))):
        use = rows.free[:, j]
        w = rows.w[use, j]
        axes.axhline(0.0, color=PALE, linewidth=0.6, zorder=0)
        axes.axvline(0.0, color=PALE, linewidth=0.6, zorder=0)
        axes.set_xlabel(f"w{j + 1} [{unit}/s]")
        axes.set_ylabel(f"torque left to friction [{torque_unit}]")
        axes.set_title(f"joint {j + 1}, before any fit")
        if not use.any():
            axes.text(0.5, 0.5, "hardly slides", transform=axes.transAxes, ha="center")
            continue
        left = verdict.evidence.torque[use, j] - rows.phi[use, j] @ verdict.told
        axes.scatter(w, left, s=4, color=BLUE, alpha=0.4, linewidths=0, rasterized=True)
        low, high = np.quantile(left, [0.005, 0.995])
        margin = 0.3 * (high - low) + 1e-9 * max(abs(low), abs(high), 1.0)
        axes.set_ylim(low - margin, high + margin)
        coulomb, viscous, offset = estimate.value[nb + 3 * j : nb + 3 * j + 3]
        for side in (-1.0, 1.0):
            ends = np.array([0.0, np.abs(w).max()]) * side
            line = coulomb * side + viscous * ends + offset
            axes.plot(ends, line, color=ORANGE, label="least squares" if side > 0 else None)
        axes.legend(loc="upper left")
