"""Friction curves: folds, truth, ensembles with their members, and bands of shooting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
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
    velocity_axis,
)
from frictionid.report.figures.style import (
    DARK,
    DASHED,
    GREY,
    PALE,
    Style,
    figure,
    key_above,
    line,
    patch,
    plain,
)
from frictionid.report.sections import DataDescription, Model, Section

COLUMNS = 4  # models side by side; more go to another picture
DENSITY = 0.16  # height of the velocity density, share of a panel
DOTTED = (0, (1, 1.6))


def friction_curves(section: Section, styles: Mapping[str, Style]) -> list[Any]:
    """Pictures of friction over velocity: a column for each model, a row for each joint.

    Fixed numbers and the truth stand in every panel. All panels of a joint have the same axes.
    """
    # models without physics have no friction curve
    fitted = [m for m in section.of_role("fitted") if np.isfinite(m.curves).any()]
    names = list(dict.fromkeys(m.label for m in fitted))
    columns = sorted(fitted, key=lambda m: names.index(m.label))  # recipes of one law side by side
    given = section.of_role("given")
    if not columns:
        columns, given = given, []
    data = section.description
    limits = [_limits([*columns, *given], data, joint) for joint in range(len(data.joints))]
    parts = side_by_side(columns, COLUMNS)
    return [_curve_picture(part, given, (data, limits), styles) for part in parts]


def _curve_picture(
    columns: Sequence[Model],
    given: Sequence[Model],
    place: tuple[DataDescription, Sequence[tuple[float, float]]],
    styles: Mapping[str, Style],
) -> Any:
    """A picture; `place` is the data set, and the ends of the joints' torque axes."""
    data, limits = place
    picture = figure(0.6 + 1.75 * len(limits))
    axes = picture.subplots(len(limits), len(columns), squeeze=False)
    for joint, row in enumerate(axes):
        for axis, model in zip(row, columns, strict=True):
            _panel(axis, model, given, (data, joint, limits[joint]), styles)
            axis.tick_params(labelleft=axis is row[0], labelbottom=joint == len(limits) - 1)
        row[0].set_ylabel(f"{data.joints[joint]}\n[{data.torque_units[joint]}]")
    for axis, model in zip(axes[0], columns, strict=True):
        axis.set_title(plain(model.name), color=styles[model.label].colour, weight="bold")
    key_above(picture, _curve_key(given, data, styles))
    picture.supxlabel(f"velocity [{data.velocity_unit}]", fontsize=8)
    return picture


def _panel(
    axis: Any,
    model: Model,
    given: Sequence[Model],
    place: tuple[DataDescription, int, tuple[float, float]],
    styles: Mapping[str, Style],
) -> None:
    """Curves of a model and a joint; `place`: data set, joint, and ends of its torque axis."""
    data, joint, limits = place
    w = data.velocity[:, joint]
    _density(axis, data, joint, limits)
    velocity_axis(axis, w, limits)
    for other in given:
        colour = styles[other.label].colour
        axis.plot(w, other.curves[-1, :, joint], "--", color=colour, linewidth=0.9, zorder=3)
    _folds(axis, model, data, joint, styles[model.label].colour)
    draw_truth(axis, data, joint)


def _limits(models: Sequence[Model], data: DataDescription, joint: int) -> tuple[float, float]:
    """Lower and upper end of a joint's torque axis, with room for the density below."""
    lines = [line[:, joint] for model in models for line in model.curves]
    if data.truth is not None:
        lines.append(data.truth[:, joint])
    values = np.concatenate(lines) if lines else np.zeros(1)
    values = values[np.isfinite(values)]
    # one wild fold must not flatten all others
    high = 1.08 * float(np.quantile(np.abs(values), 0.999)) if len(values) else 0.0
    high = high or 1.0
    return -high - DENSITY * 2 * high / (1 - DENSITY), high


def _density(axis: Any, data: DataDescription, joint: int, limits: tuple[float, float]) -> None:
    """The velocity density as a grey area at the bottom."""
    w, density = data.velocity[:, joint], data.density[joint]
    edges = np.linspace(w[0], w[-1], len(density) + 1)
    # joints rest often: bars taller than nearly all others are cut, or these could not be seen
    full = float(np.quantile(density, 0.95)) or float(density.max()) or 1.0
    height = DENSITY * (limits[1] - limits[0]) * np.minimum(density / full, 1)
    axis.stairs(limits[0] + height, edges, baseline=limits[0], fill=True, color=PALE, linewidth=0)


def _folds(axis: Any, model: Model, data: DataDescription, joint: int, colour: str) -> None:
    w = data.velocity[:, joint]
    folds, overall = model.curves[:-1, :, joint], model.curves[-1, :, joint]
    axis.plot(w, folds.T, color=colour, linewidth=0.5, alpha=0.45)
    if np.isfinite(folds).all():  # no mean where a fold has none
        axis.plot(w, folds.mean(axis=0), color=colour, linewidth=1.6)
    axis.plot(w, overall, color=DARK, linewidth=0.7, linestyle=DOTTED, zorder=4)


def _curve_key(
    given: Sequence[Model],
    data: DataDescription,
    styles: Mapping[str, Style],
) -> dict[str, Any]:
    key = {
        "each fold": line(GREY, linewidth=0.6, alpha=0.6),
        "mean of folds": line(GREY, linewidth=1.6),
        "fit to all data": line(DARK, DOTTED, 0.8),
    }
    key |= {model.label: line(styles[model.label].colour, "--", 1) for model in given}
    if data.truth is not None:
        key["truth"] = line(DARK, DASHED, 1)
    return {**key, "velocity density, cut": patch(PALE)}


STRONG, WEAK = 0.5, 0.22  # opacity of the pointwise and the simultaneous band


class Band(NamedTuple):
    """Curve (V,) of a joint at velocities (V,), with half-widths (V,)."""

    velocity: Array
    curve: Array
    pointwise: Array
    simultaneous: Array


def curve_bands(
    fits: Sequence[Model], data: DataDescription, styles: Mapping[str, Style]
) -> list[Any]:
    """Pictures of curves and, below each, of the bands about it: a column for each fit."""
    return [_band_picture(shown, fits, data, styles) for shown in side_by_side(fits)]


def _band_picture(
    shown: Sequence[Model],
    every: Sequence[Model],
    data: DataDescription,
    styles: Mapping[str, Style],
) -> Any:
    picture, axes = paired_panels(len(shown), data, 1 / 1.5)
    for joint in range(len(data.joints)):
        bands = {model: band_of(model, data, joint) for model in every}
        high = 1.12 * most([np.abs(band.curve) for band in bands.values()])
        near = {model: _near_band(model, bands[model], data, joint) for model in every}
        scale, prefix = prefixed(max(near.values()))
        axes[2 * joint + 1, 0].set_ylabel(f"about the fit\n[{prefix}{data.torque_units[joint]}]")
        for c, model in enumerate(shown):
            band, colour = bands[model], styles[model.label].colour
            upper, lower = axes[2 * joint : 2 * joint + 2, c]
            frame(upper, band.velocity, data, joint, high)
            _fill(upper, band, band.curve, colour)
            upper.plot(band.velocity, band.curve, color=colour, linewidth=1.2)
            draw_truth(upper, data, joint)
            frame(lower, band.velocity, data, joint, scale * near[model])
            small = Band(band.velocity, *(scale * part for part in band[1:]))
            _fill(lower, small, 0.0 * small.curve, colour)
            lower.axhline(0, color=colour, linewidth=1.2)
            draw_error(lower, model, data, joint, scale)
    label_panels(picture, axes, shown, data, styles)
    key_above(picture, _band_key(data))
    return picture


def draw_error(axis: Any, model: Model, data: DataDescription, joint: int, scale: float) -> None:
    """The true curve less the fitted one, times a scale, where the truth is known."""
    off = error_to_truth(model, data, joint)
    if off is not None:
        axis.plot(off[0], scale * off[1], color=DARK, linewidth=1, linestyle=DASHED)


def band_of(model: Model, data: DataDescription, joint: int) -> Band:
    """A joint's band; documents without velocities of their own have it on the curves' grid."""
    own = (model.refined or {})["bands"]
    velocity = own.get("velocity", data.velocity)
    curve = own.get("curve", model.curves[-1])
    parts = (velocity, curve, own["pointwise"], own["simultaneous"])
    return Band(*(np.asarray(part, dtype=float)[:, joint] for part in parts))


def _near_band(model: Model, band: Band, data: DataDescription, joint: int) -> float:
    """End of the axis of what is about a curve: each fit has its own, to show its bands."""
    return near_end([band.simultaneous[measured(band.velocity, data, joint)]], model, data, joint)


def near_end(parts: list[Array], model: Model, data: DataDescription, joint: int) -> float:
    """End of an axis that shows all parts, and the truth if it is not far from them."""
    off = error_to_truth(model, data, joint)
    if off is not None:
        # a truth far away must not flatten the rest
        parts = [*parts, np.minimum(np.abs(off[1]), 4 * most(parts))]
    return 1.12 * most(parts)


def _fill(axis: Any, band: Band, middle: Array, colour: str) -> None:
    for half, alpha in ((band.simultaneous, WEAK), (band.pointwise, STRONG)):
        low, high = middle - half, middle + half
        axis.fill_between(band.velocity, low, high, color=colour, alpha=alpha, linewidth=0)


def _band_key(data: DataDescription) -> dict[str, Any]:
    truth = {} if data.truth is None else {"truth": line(DARK, DASHED, 1)}
    return {
        "fit to all data": line(GREY),
        "95 % at each velocity": patch(GREY, STRONG + WEAK / 2),
        "95 % at all velocities": patch(GREY, WEAK),
        "not measured": unmeasured_patch(),
        **truth,
    }


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
