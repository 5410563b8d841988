"""Friction that is the mean of an ensemble: how far its members differ, and from the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.bands import draw_error, near_end
from frictionid.report.figures.panels import (
    draw_truth,
    frame,
    label_panels,
    measured,
    most,
    paired_panels,
    prefixed,
    side_by_side,
    unmeasured_patch,
)
from frictionid.report.figures.style import DARK, DASHED, GREY, Style, key_above, line
from frictionid.report.sections import DataDescription, Model, Section


def ensembles(section: Section) -> list[Model]:
    """Models whose friction is the mean of several members."""
    return [model for model in section.models if model.members is not None]


def spread_caption(section: Section) -> str:
    """Part of a caption on the members of ensembles; "" where there is none."""
    models = ensembles(section)
    if not models:
        return ""
    sizes = {
        m.label: f"{len(m.members)} members of {m.label}" for m in models if m.members is not None
    }
    return (
        f" The {', '.join(sizes.values())} differ by their initial weights and the recordings held "
        "out. That is no interval: how far they spread says little of how far their mean is off."
    )


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
        axes[2 * joint + 1, 0].set_ylabel(f"about the mean\n[{prefix}{data.torque_units[joint]}]")
        for c, model in enumerate(shown):
            colour, (upper, lower) = styles[model.label].colour, axes[2 * joint : 2 * joint + 2, c]
            mean = _mean(model, joint)
            frame(upper, w, data, joint, high)
            upper.plot(w, mean, color=colour, linewidth=1.2)
            draw_truth(upper, data, joint)
            frame(lower, w, data, joint, scale * near)
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


def _members(model: Model, joint: int) -> Array:
    """Curves (N, V) of the members less their mean."""
    members = np.empty((0, 0, 0)) if model.members is None else model.members
    return np.asarray(members[..., joint] - _mean(model, joint))


def _high(model: Model, joint: int) -> float:
    """The largest torque of a joint's curve."""
    return most([np.abs(_mean(model, joint))])


def _near(model: Model, data: DataDescription, joint: int) -> float:
    """End of the axis of what is about the mean, the same for all ensembles."""
    inside = measured(data.velocity[:, joint], data, joint)
    return near_end([np.abs(_members(model, joint))[:, inside].ravel()], model, data, joint)


def _key(data: DataDescription, colour: str) -> dict[str, Any]:
    key = {
        "mean, fit to all data": line(colour),
        "each member": line(colour, linewidth=0.6, alpha=0.7),
    }
    if not all(measured(w, data, joint).all() for joint, w in enumerate(data.velocity.T)):
        key["not measured"] = unmeasured_patch()
    return key if data.truth is None else {**key, "truth": line(DARK, DASHED, 1)}
