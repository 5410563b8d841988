"""Picture of one fitted model: friction over velocity, with its band where it was shot."""

from __future__ import annotations

from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import EstimatedStates, curves, speeds, velocity_grid
from frictionid.evaluation.ground_truth import steady_state
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.formulation import INTEGRAL
from frictionid.friction import Friction
from frictionid.report.figures.panels import panel_grid, velocity_axis
from frictionid.report.figures.style import (
    COLOURS,
    DARK,
    DASHED,
    PALE,
    drawing,
    key_above,
    line,
    patch,
    rendered,
)

_HIGH = 1.25  # of the largest friction shown
_BAND, _SPEEDS = 0.3, 0.12  # opacity of the band; height of the speeds' density, share of a panel
_BINS = 60


def check_drawable(identifier: Identifier) -> None:
    """Check that what an identifier fits has a friction torque to draw.

    Raises
    ------
    InputError
        For models of the whole acceleration.
    """
    if not identifier.uses_mechanism:
        raise InputError("--figure: a model without physics has no friction torque to draw")


def fit_picture(friction: Friction, dataset: Dataset) -> bytes:
    """PNG of `fit_figure`."""
    with drawing():
        return rendered(fit_figure(friction, dataset), ("png",))["png"]


def fit_figure(friction: Friction, dataset: Dataset) -> Any:
    """Friction of each joint, and of each part that turns with several, over a data set's speeds.

    With the 95 % band where the friction was refined by shooting, and the truth where it is known.
    """
    w = speeds(dataset, EstimatedStates(dataset).by(INTEGRAL.states))
    grid = velocity_grid(w)
    description = dataset.mechanism
    curve = curves(friction, grid)
    truth = None if dataset.truth is None else curves(steady_state(dataset.truth), grid)
    half = _half_widths(friction, grid)
    picture, panels = panel_grid(len(description.friction_names), 2, 2.8, 0.4)
    for j, axes in enumerate(panels):
        _panel(axes, grid[:, j], curve[:, j], None if half is None else half[:, j])
        if truth is not None:
            axes.plot(grid[:, j], truth[:, j], color=DARK, linewidth=1, linestyle=DASHED)
        _density(axes, w[:, j], grid[:, j])
        axes.set_title(description.friction_names[j], loc="left")
        axes.set_xlabel(f"velocity [{description.friction_units[j]}/s]")
        axes.set_ylabel(f"friction [{description.friction_torque_units[j]}]")
    key_above(picture, _key(half is not None, truth is not None))
    return picture


def _half_widths(friction: Friction, grid: Array) -> Array | None:
    """Half-widths (V, n) of the simultaneous 95 % band, where the model's document has one."""
    bands: Any = friction.provenance.get("refined", {}).get("bands")
    if not bands:
        return None
    at, half = (np.asarray(bands[key], dtype=float) for key in ("velocity", "simultaneous"))
    columns = zip(grid.T, at.T, half.T, strict=True)
    return np.stack([np.interp(w, own, size) for w, own, size in columns], axis=-1)


def _panel(axes: Any, w: Array, curve: Array, half: Array | None) -> None:
    end = _HIGH * float(np.nanmax(np.abs(curve), initial=0.0)) or 1.0
    velocity_axis(axes, w, (-end, end))
    if half is not None:
        axes.fill_between(w, curve - half, curve + half, color=COLOURS[0], alpha=_BAND, lw=0)
    axes.plot(w, curve, color=COLOURS[0], linewidth=1.5)


def _density(axes: Any, w: Array, grid: Array) -> None:
    """How often each velocity occurred, as a grey area at the bottom, rest cut."""
    counts, edges = np.histogram(w, bins=_BINS, range=(grid[0], grid[-1]))
    low, high = axes.get_ylim()
    full = float(np.quantile(counts, 0.95)) or 1.0
    height = _SPEEDS * (high - low) * np.minimum(counts / full, 1.0)
    axes.stairs(low + height, edges, baseline=low, fill=True, color=PALE, linewidth=0)


def _key(band: bool, truth: bool) -> dict[str, Any]:
    key = {"fit to all data": line(COLOURS[0], linewidth=1.5)}
    if band:
        key["95 % at all velocities"] = patch(COLOURS[0], _BAND)
    if truth:
        key["truth"] = line(DARK, DASHED, 1)
    return {**key, "how often each velocity occurred": patch(PALE)}
