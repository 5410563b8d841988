"""Pictures of a verdict: where the joints have been, what moved them, friction before any fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.check import Verdict
from frictionid.check.motion import Motion
from frictionid.check.regression import one_way
from frictionid.data.recordings import Recording
from frictionid.files import write_bytes
from frictionid.mechanics import Mechanism
from frictionid.report.figures.style import (
    COLOURS,
    PALE,
    drawing,
    figure,
    key_above,
    line,
    marker,
    panel_grid,
    plain,
    rendered,
)
from frictionid.report.numbers import either

MOVING, RESTING = COLOURS[:2]
RECORDINGS = 3  # shown over time
ABREAST = 3  # joints side by side


def picture_paths(folder: Path) -> list[Path]:
    """Paths of the pictures: coverage, motion and residual torque (PNG)."""
    return [folder / f"{name}.png" for name in PICTURES]


def write_pictures(verdict: Verdict, folder: Path) -> list[Path]:
    """Paths of the pictures written, see `picture_paths`."""
    paths = picture_paths(folder)
    with drawing():
        pictures = [rendered(draw(verdict), ["png"])["png"] for draw in PICTURES.values()]
    for path, picture in zip(paths, pictures, strict=True):
        write_bytes(path, picture)
    return paths


def _mechanism(verdict: Verdict) -> Mechanism:
    return verdict.regression.measured.dataset.mechanism


def _coverage(verdict: Verdict) -> Any:
    """The (q, w) plane of each joint, rest marked."""
    units = _mechanism(verdict).position_units
    picture, panels = panel_grid(len(verdict.joints), ABREAST, 2.4, 0.35)
    states = [m.states for m in verdict.regression.measured.motions]
    q, w = np.concatenate([s.q for s in states]), np.concatenate([s.w for s in states])
    size = float(np.clip(2e4 / len(q), 0.3, 4.0))
    for j, axes in enumerate(panels):
        fact = verdict.joints[j]
        still = np.abs(w[:, j]) < fact.rest_speed
        for which, colour in ((~still, MOVING), (still, RESTING)):
            axes.scatter(q[which, j], w[which, j], s=size, color=colour, lw=0, rasterized=True)
        axes.axhline(0.0, color=PALE, linewidth=0.6, zorder=0)
        axes.set_title(f"joint {j + 1}: {100 * fact.at_rest:.0f} % of the time at rest", loc="left")
        axes.set_xlabel(f"q{j + 1} [{units[j]}]")
        axes.set_ylabel(f"w{j + 1} [{units[j]}/s]")
    key_above(picture, {"moving": marker(MOVING), "at rest, or too slow to tell": marker(RESTING)})
    return picture


def _motion(verdict: Verdict) -> Any:
    """Angles, velocities and torques over time, of the recordings that move most."""
    measured, mechanism = verdict.regression.measured, _mechanism(verdict)
    slides = set(mechanism.position_units) == {"m"}
    chosen, joints = _chosen(verdict), range(len(verdict.joints))
    picture = figure(4.6)
    rows = picture.subplots(3, len(chosen), sharex="col", sharey="row", squeeze=False)
    for column, i in zip(rows.T, chosen, strict=True):
        _over_time(column, measured.dataset.recordings[i], measured.motions[i], joints)
    labels = (
        f"{'position' if slides else 'angle'} [{either(mechanism.position_units)}]",
        f"velocity [{either(mechanism.velocity_units)}]",
        f"{'force' if slides else 'torque'} [{either(mechanism.torque_units)}]",
    )
    for axes, label in zip(rows[:, 0], labels, strict=True):
        axes.set_ylabel(label)
    key_above(picture, {f"joint {j + 1}": rows[0][0].lines[j] for j in joints})
    return picture


def _over_time(column: Any, recording: Recording, motion: Motion, joints: range) -> None:
    states, torque = motion.states, recording.torque
    start = states.time[0]
    held = "steps-post" if torque.hold == "previous" else "default"
    for j in joints:
        colour = COLOURS[j % len(COLOURS)]
        column[0].plot(states.time - start, states.q[:, j], color=colour, lw=1.0)
        column[1].plot(states.time - start, states.w[:, j], color=colour, lw=1.0)
        column[2].plot(
            torque.time - start, torque.value[:, j], color=colour, drawstyle=held, lw=0.7
        )
    column[0].set_title(plain(recording.name.rsplit("/", 1)[-1]), fontsize=7, loc="left")
    column[2].set_xlabel("time [s]")
    column[2].set_xlim(0.0, states.time[-1] - start)


def _chosen(verdict: Verdict) -> list[int]:
    """Recordings to show: those in which the joints are fastest for them, in their own order."""
    square = np.stack([np.mean(m.states.w**2, 0) for m in verdict.regression.measured.motions])
    speed = np.mean(square / np.maximum(square.mean(0), 1e-300), axis=1)
    return sorted(np.argsort(speed)[::-1][:RECORDINGS].tolist())


def _residual(verdict: Verdict) -> Any:
    """Torque that the nominal mechanism leaves to friction, against velocity, and least squares."""
    rows = verdict.regression.rows
    mechanism = _mechanism(verdict)
    picture, panels = panel_grid(len(verdict.joints), ABREAST, 2.4, 0.35)
    for j, axes in enumerate(panels):
        axes.axhline(0.0, color=PALE, linewidth=0.6, zorder=0)
        axes.axvline(0.0, color=PALE, linewidth=0.6, zorder=0)
        axes.set_xlabel(f"w{j + 1} [{mechanism.velocity_units[j]}]")
        axes.set_ylabel(f"residual torque [{mechanism.torque_units[j]}]")
        axes.set_title(f"joint {j + 1}", loc="left")
        if one_way(rows, j).any():
            _friction(axes, verdict, j)
        else:
            axes.text(0.5, 0.5, "hardly moves", transform=axes.transAxes, ha="center")
    key_above(
        picture,
        {"nominal mechanism, before any fit": marker(MOVING), "least squares": line(RESTING)},
    )
    return picture


def _friction(axes: Any, verdict: Verdict, j: int) -> None:
    rows, torque = verdict.regression.rows, verdict.regression.torque
    nb = len(verdict.nominal)
    use = one_way(rows, j)
    w = rows.w[use, j]
    left = torque[use, j] - rows.regressor[use, j] @ verdict.nominal
    size = float(np.clip(6e3 / len(w), 1.0, 4.0))
    axes.scatter(w, left, s=size, color=MOVING, alpha=0.4, linewidths=0, rasterized=True)
    low, high = np.quantile(left, [0.005, 0.995])
    margin = 0.3 * (high - low) + 1e-9 * max(abs(low), abs(high), 1.0)
    axes.set_ylim(low - margin, high + margin)
    coulomb, viscous, offset = verdict.estimate.value[nb + 3 * j : nb + 3 * j + 3]
    for side in (-1.0, 1.0):
        ends = np.array([0.0, np.abs(w).max()]) * side
        axes.plot(ends, coulomb * side + viscous * ends + offset, color=RESTING)


PICTURES: Mapping[str, Callable[[Verdict], Any]] = {
    "coverage": _coverage,
    "motion": _motion,
    "residual": _residual,
}
