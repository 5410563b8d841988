"""Friction curves: folds, truth, and bands of shooting."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.curves import slow_speed
from frictionid.evaluation.predicted_motion import jackknife_width
from frictionid.evaluation.statistics import FEWEST
from frictionid.friction.provenance import Bands

from ..sections import DataDescription, Model, Section
from .style import (
    DARK,
    DASHED,
    DENSITY,
    GREY,
    PALE,
    Styles,
    draw_truth,
    figure,
    frame,
    key_above,
    line,
    measured,
    model_title,
    most,
    panels,
    patch,
    plain,
    side_by_side,
    truth_key,
    unmeasured_patch,
    velocity_axis,
)

COLUMNS = 4  # models side by side; more go to another picture
DOTTED = (0, (1, 1.6))
Limits = tuple[float, float]


def friction_curves(section: Section, styles: Styles) -> list[Any]:
    """Pictures of friction over velocity: a column for each model, a row for each joint.

    Fixed numbers and the truth stand in every panel. All panels of a joint have the same axes.
    """
    # models without physics have no friction curve
    fitted = [m for m in section.of_role("fitted") if np.isfinite(m.curves).any()]
    names = list(dict.fromkeys(m.label for m in fitted))
    columns = sorted(fitted, key=lambda m: names.index(m.label))  # recipes of one law side by side
    fixed = section.of_role("given")
    if not columns:
        columns, fixed = fixed, []
    data = section.description
    limits = [_limits([*columns, *fixed], data, joint) for joint in range(len(data.joints))]
    parts = side_by_side(columns, COLUMNS)
    return [_curve_picture(part, fixed, data, limits, styles) for part in parts]


def _curve_picture(
    columns: Sequence[Model],
    fixed: Sequence[Model],
    data: DataDescription,
    limits: Sequence[Limits],
    styles: Styles,
) -> Any:
    """A picture; `limits` are the ends of the joints' torque axes."""

    def draw(axis: Any, joint: int, column: int) -> None:
        w, model = data.velocity[:, joint], columns[column]
        velocity_axis(axis, w, limits[joint])
        draw_density(axis, *density_heights(data, joint), DENSITY)
        for other in fixed:
            dashed = {"color": styles[other.label].colour, "linewidth": 0.9, "zorder": 3}
            axis.plot(w, other.curves[-1, :, joint], "--", **dashed)
        _folds(axis, w, model.curves[..., joint], styles[model.label].colour)
        draw_truth(axis, data, joint)
        axis.tick_params(labelleft=column == 0, labelbottom=joint == len(limits) - 1)
        if joint == 0:
            model_title(axis, model, styles)

    key = {
        "each fold": line(GREY, linewidth=0.6, alpha=0.6),
        "mean of folds": line(GREY, linewidth=1.6),
        "fit to all data": line(DARK, DOTTED, 0.8),
        **{model.label: line(styles[model.label].colour, "--", 1) for model in fixed},
        **truth_key(data.truth),
        "velocity density, cut": patch(PALE),
    }
    pairs = zip(data.joints, data.torque_units, strict=True)
    labels = [f"{name}\n[{unit}]" for name, unit in pairs]
    titles = [""] * len(columns)
    return panels(draw, labels, titles, key, f"velocity [{data.velocity_unit}]", 1.75)


def _limits(models: Sequence[Model], data: DataDescription, joint: int) -> Limits:
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


def density_heights(data: DataDescription, joint: int) -> tuple[Array, Array]:
    """Edges of the velocity bins (B + 1,), and heights (B,) up to 1 of how often each occurred."""
    w, density = data.velocity[:, joint], data.density[joint]
    return np.linspace(w[0], w[-1], len(density) + 1), cut_heights(density)


def cut_heights(counts: Array) -> Array:
    """Heights up to 1: joints rest often, and uncut bars of rest would flatten all others."""
    full = float(np.quantile(counts, 0.95)) or float(counts.max()) or 1.0
    return np.minimum(counts / full, 1.0)


def draw_density(axis: Any, edges: Array, heights: Array, share: float) -> None:
    """How often each velocity occurred, as a grey area in the lowest share of a panel."""
    low, high = axis.get_ylim()
    tops = low + share * (high - low) * heights
    axis.stairs(tops, edges, baseline=low, fill=True, color=PALE, linewidth=0)


def _folds(axis: Any, w: Array, curves: Array, colour: str) -> None:
    """Curves (F + 1, V) of a joint: each fold, their mean, and dotted the fit to all data."""
    folds = curves[:-1]
    axis.plot(w, folds.T, color=colour, linewidth=0.5, alpha=0.45)
    if np.isfinite(folds).all():  # no mean where a fold has none
        axis.plot(w, folds.mean(axis=0), color=colour, linewidth=1.6)
    axis.plot(w, curves[-1], color=DARK, linewidth=0.7, linestyle=DOTTED, zorder=4)


# --- A curve, and below it its bands by shooting --------------------------------------------------

STRONG, WEAK = 0.5, 0.22  # opacity of the pointwise and the simultaneous band


def band_of(model: Model, joint: int) -> Bands:
    """A joint's curve (V,) at velocities (V,), with half-widths (V,)."""
    assert model.refined is not None and model.refined.bands is not None
    return Bands(*(part[:, joint] for part in model.refined.bands[:4]))


def curve_and_band(model: Model, data: DataDescription, joint: int) -> tuple[Array, Array, Array]:
    """Velocities (V,), a joint's curve, and half the width of its 95 % band, NaN where unknown.

    By shooting, else by what leaving out each fold changes.
    """
    if model.refined is not None and model.refined.bands is not None:
        velocity, curve, half = band_of(model, joint)[:3]
        return velocity, curve, half
    curves = model.curves[..., joint]
    enough = model.role == "fitted" and len(curves) > FEWEST
    half = jackknife_width(curves[:-1]) if enough else np.full(curves.shape[1], np.nan)
    return data.velocity[:, joint], curves[-1], half


def curve_bands(section: Section, styles: Styles) -> list[Any]:
    """Pictures of fits with intervals: a column for each, its bands about it below."""
    return [_bands_picture(section, part, styles) for part in side_by_side(section.shot)]


def _bands_picture(section: Section, shown: Sequence[Model], styles: Styles) -> Any:
    """Curves of the shown models and, below each, its bands, on the axes of all models."""
    data = section.description
    joints = len(data.joints)
    picture = figure(0.55 + 2.5 * joints)
    heights = {"height_ratios": [1.0, 1 / 1.5] * joints}
    axes = picture.subplots(2 * joints, len(shown), squeeze=False, gridspec_kw=heights)
    for joint, name in enumerate(data.joints):
        bands = {model: band_of(model, joint) for model in section.shot}
        high = 1.12 * max(_height(band, data, joint) for band in bands.values())
        ends = {model: _near(model, band, data, joint) for model, band in bands.items()}
        scale, prefix = prefixed(max(ends.values()))
        unit = data.torque_units[joint]
        axes[2 * joint, 0].set_ylabel(f"{plain(name)}\n[{unit}]")
        axes[2 * joint + 1, 0].set_ylabel(f"about the fit\n[{prefix}{unit}]")
        for c, model in enumerate(shown):
            band, colour = bands[model], styles[model.label].colour
            upper, lower = axes[2 * joint : 2 * joint + 2, c]
            upper.tick_params(labelbottom=False, labelleft=c == 0)
            frame(upper, band.velocity, data, joint, high)
            _fill(upper, band, colour)
            upper.plot(band.velocity, band.curve, color=colour, linewidth=1.2)
            draw_truth(upper, data, joint)
            frame(lower, band.velocity, data, joint, scale * ends[model])
            halves = (scale * half for half in (band.pointwise, band.simultaneous))
            _fill(lower, Bands(band.velocity, 0.0 * band.curve, *halves), colour)
            lower.axhline(0, color=colour, linewidth=1.2)
            off = error_to_truth(model, data, joint)
            if off is not None:
                lower.plot(off[0], scale * off[1], color=DARK, linewidth=1, linestyle=DASHED)
    for axis, model in zip(axes[0], shown, strict=True):
        model_title(axis, model, styles)
    picture.align_ylabels(axes[:, 0])
    picture.supxlabel(f"velocity [{data.velocity_unit}]")
    key = {
        "fit to all data": line(GREY),
        "95 % at each velocity": patch(GREY, STRONG + WEAK / 2),
        "95 % at all velocities": patch(GREY, WEAK),
        "not measured": unmeasured_patch(),
    }
    key_above(picture, key | truth_key(data.truth))
    return picture


def _height(band: Bands, data: DataDescription, joint: int) -> float:
    """How high a curve reaches with its band, where the joint moved."""
    inside = measured(band.velocity, data, joint)
    return most([(np.abs(band.curve) + np.nan_to_num(band.simultaneous))[inside]])


def _near(model: Model, band: Bands, data: DataDescription, joint: int) -> float:
    """End of an axis that shows the band about a curve, and the truth if it is not far from it."""
    inside = measured(band.velocity, data, joint)
    parts = [band.simultaneous[inside]]
    off = error_to_truth(model, data, joint)
    if off is not None:
        # a truth far away must not flatten the rest
        parts = [*parts, np.minimum(np.abs(off[1]), 4 * most(parts))]
    return 1.12 * most(parts)


def _fill(axis: Any, band: Bands, colour: str) -> None:
    for half, alpha in ((band.simultaneous, WEAK), (band.pointwise, STRONG)):
        edges = band.curve - half, band.curve + half
        axis.fill_between(band.velocity, *edges, color=colour, alpha=alpha, linewidth=0)


def error_to_truth(model: Model, data: DataDescription, joint: int) -> tuple[Array, Array] | None:
    """Velocities (V,) and the true curve less the fitted one, where the truth is known."""
    if data.truth is None:
        return None
    w = data.velocity[:, joint]
    off = data.truth[:, joint] - model.curves[-1][:, joint]
    return w, np.where(np.abs(w) < slow_speed(np.abs(w).max()), np.nan, off)


def prefixed(size: float) -> tuple[float, str]:
    """Factor and prefix of the unit in which numbers up to a size are read best.

    >>> prefixed(5.0), prefixed(0.02), prefixed(1e-4)
    ((1.0, ''), (1000.0, 'm'), (1000000.0, 'µ'))
    """
    for scale, prefix in ((1.0, ""), (1e3, "m")):
        if scale * size >= 0.5:
            return scale, prefix
    return 1e6, "µ"
