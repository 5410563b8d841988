"""Picture of a first verdict: friction over velocity by all laws, and their errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.mechanics import Mechanism
from frictionid.quickstart.quick import Candidate, Quick
from frictionid.report.figures.style import (
    COLOURS,
    DARK,
    GREY,
    drawing,
    key_above,
    line,
    panel_grid,
    plain_logarithm,
    rendered,
    velocity_axis,
)
from frictionid.report.numbers import norm_unit

_HIGH = 1.25  # of the largest friction shown


def quick_picture(found: Quick) -> bytes:
    """PNG of `quick_figure`."""
    with drawing():
        return rendered(quick_figure(found), ("png",))["png"]


def quick_figure(found: Quick) -> Any:
    """For each joint friction over velocity, each fold thin; then the errors of the folds."""
    mechanism = found.check.regression.measured.dataset.mechanism
    colours = _colours(found)
    joints = len(mechanism.joints)
    picture, panels = panel_grid(joints + 1, 3, 2.7, 0.4)
    for joint, axes in enumerate(panels[:joints]):
        _friction(axes, found, joint, mechanism, colours)
    _errors(panels[joints], found, mechanism, colours)
    key = {_label(c, found): line(colours[c.name]) for c in found.candidates if c.parameters}
    key_above(picture, {**key, "each fold": line(GREY, linewidth=0.5)})
    return picture


def _colours(found: Quick) -> dict[str, str]:
    laws = [c.name for c in found.candidates if c.parameters]
    return {"none": GREY, **dict(zip(laws, COLOURS, strict=False))}


def _label(c: Candidate, found: Quick) -> str:
    return f"{c.name}: the verdict" if c is found.chosen else c.name


def _friction(
    axes: Any, found: Quick, joint: int, mechanism: Mechanism, colours: dict[str, str]
) -> None:
    assert found.velocity is not None
    w = found.velocity[:, joint]
    high = 0.0
    for c in found.candidates:
        if not c.parameters:
            continue
        folds, overall = c.curves[:-1, :, joint], c.curves[-1, :, joint]
        axes.plot(w, folds.T, color=colours[c.name], linewidth=0.4, alpha=0.5)
        width, order = (1.8, 4) if c is found.chosen else (1.0, 3)
        axes.plot(w, overall, color=colours[c.name], linewidth=width, zorder=order)
        high = max(high, float(np.abs(overall).max()))
    end = _HIGH * high or 1.0
    velocity_axis(axes, w, (-end, end))
    axes.set_title(mechanism.joints[joint], loc="left")
    axes.set_xlabel(f"velocity [{mechanism.velocity_units[joint]}]")
    axes.set_ylabel(f"friction [{mechanism.torque_units[joint]}]")


def _errors(axes: Any, found: Quick, mechanism: Mechanism, colours: dict[str, str]) -> None:
    for place, c in enumerate(found.candidates):
        offsets = np.linspace(-0.15, 0.15, len(c.by_fold))
        axes.plot(place + offsets, c.by_fold, "o", color=colours[c.name], markersize=3, alpha=0.5)
        axes.plot([place - 0.3, place + 0.3], 2 * [c.error], color=colours[c.name], linewidth=2)
    plain_logarithm(axes)
    axes.set_xticks(range(len(found.candidates)), [c.name for c in found.candidates], rotation=20)
    axes.set_title(f"after {found.horizon:g} s, held out; dots: folds", loc="left", color=DARK)
    axes.set_ylabel(f"error [{norm_unit(mechanism.position_units)}]")
