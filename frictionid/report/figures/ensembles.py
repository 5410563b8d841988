"""Friction that is the mean of an ensemble: how far its members differ, and from the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.bands import draw_error, near_end
from frictionid.report.figures.panels import (
    draw_truth,
    error_to_truth,
    frame,
    label_panels,
    measured,
    most,
    paired_panels,
    prefixed,
    side_by_side,
    unmeasured_patch,
)
from frictionid.report.figures.style import DARK, DASHED, GREY, Style, key_above, line, patch
from frictionid.report.numbers import percent
from frictionid.report.sections import DataDescription, Model, Section

OPACITY = 0.3  # of the band of one standard deviation


def ensembles(section: Section) -> list[Model]:
    """Models whose friction is the mean of several members."""
    return [model for model in section.models if model.members is not None]


def spread(model: Model) -> Array | None:
    """Standard deviation (V, n) over the members of an ensemble at each velocity; else None."""
    return None if model.members is None else model.members.std(axis=0, ddof=1)


def spread_caption(section: Section) -> str:
    """Part of a caption on the shaded bands of ensembles; "" where there is none."""
    data, models = section.description, ensembles(section)
    if not models:
        return ""
    sizes = {
        m.label: f"{len(m.members)} members of {m.label}" for m in models if m.members is not None
    }
    caption = (
        f" Shaded: one standard deviation over the {', '.join(sizes.values())}, to either side of "
        "their mean, the fit to all data. Members differ by their initial weights and the "
        "recordings held out: no calibrated interval."
    )
    if data.truth is None:
        return caption
    shares = ", ".join(f"{m.name} {percent(share_held(m, data))}" for m in models)
    return f"{caption} Share of the velocities at which it holds the truth: {shares}."


def share_held(model: Model, data: DataDescription) -> float:
    """Share of the velocities and joints at which the truth is within the spread."""
    half = spread(model)
    assert half is not None
    parts = [error_to_truth(model, data, joint) for joint in range(half.shape[1])]
    off = np.stack([part[1] for part in parts if part is not None], axis=-1)
    known = np.isfinite(off)
    return float(np.mean((np.abs(off) <= half)[known]))


def spreads(section: Section, styles: Mapping[str, Style]) -> list[Any]:
    """Pictures of ensembles: curves and, below each, its members about it; a column for each."""
    models = ensembles(section)
    return [_picture(part, models, section.description, styles) for part in side_by_side(models)]


def _picture(
    shown: Sequence[Model],
    every: Sequence[Model],
    data: DataDescription,
    styles: Mapping[str, Style],
) -> Any:
    picture, axes = paired_panels(len(shown), data, 1.3)
    for joint in range(len(data.joints)):
        w = data.velocity[:, joint]
        high = 1.12 * max(_high(model, joint) for model in every)
        near = max(_near(model, data, joint) for model in every)
        scale, prefix = prefixed(near)
        axes[2 * joint + 1, 0].set_ylabel(f"about the mean\n[{prefix}{data.torque_unit}]")
        for c, model in enumerate(shown):
            colour, (upper, lower) = styles[model.label].colour, axes[2 * joint : 2 * joint + 2, c]
            mean, half = _mean(model, joint), _half(model, joint)
            frame(upper, w, data, joint, high)
            _fill(upper, w, mean, half, colour)
            upper.plot(w, mean, color=colour, linewidth=1.2)
            draw_truth(upper, data, joint)
            frame(lower, w, data, joint, scale * near)
            _fill(lower, w, 0.0 * half, scale * half, colour)
            members = scale * _members(model, joint).T
            lower.plot(w, members, color=colour, linewidth=0.6, alpha=0.7)
            lower.axhline(0, color=colour, linewidth=1.2)
            draw_error(lower, model, data, joint, scale)
            lower.tick_params(labelleft=c == 0)
    label_panels(picture, axes, shown, data, styles)
    key_above(picture, _key(data, styles[shown[0].label].colour if len(shown) == 1 else GREY))
    return picture


def _mean(model: Model, joint: int) -> Array:
    return np.asarray(model.curves[-1][:, joint])


def _half(model: Model, joint: int) -> Array:
    half = spread(model)
    assert half is not None
    return half[:, joint]


def _members(model: Model, joint: int) -> Array:
    """Curves (N, V) of the members less their mean."""
    members = np.empty((0, 0, 0)) if model.members is None else model.members
    return np.asarray(members[..., joint] - _mean(model, joint))


def _high(model: Model, joint: int) -> float:
    """The largest torque of a joint's curve and its band."""
    return most([np.abs(_mean(model, joint)) + _half(model, joint)])


def _near(model: Model, data: DataDescription, joint: int) -> float:
    """End of the axis of what is about the mean, the same for all ensembles."""
    inside = measured(data.velocity[:, joint], data, joint)
    return near_end([np.abs(_members(model, joint))[:, inside].ravel()], model, data, joint)


def _fill(axis: Any, w: Array, middle: Array, half: Array, colour: str) -> None:
    axis.fill_between(w, middle - half, middle + half, color=colour, alpha=OPACITY, linewidth=0)


def _key(data: DataDescription, colour: str) -> dict[str, Any]:
    key = {
        "mean, fit to all data": line(colour),
        "each member": line(colour, linewidth=0.6, alpha=0.7),
        "± one standard deviation": patch(colour, OPACITY),
    }
    if not all(measured(w, data, joint).all() for joint, w in enumerate(data.velocity.T)):
        key["not measured"] = unmeasured_patch()
    return key if data.truth is None else {**key, "truth": line(DARK, DASHED, 1)}
