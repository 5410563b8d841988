"""A single fit, or that of a verdict: friction with its band, correlation of its parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import EstimatedStates, speeds, steady_state, velocity_grid
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.one_step.recipe import INTEGRAL
from frictionid.friction import Friction
from frictionid.friction.provenance import Estimate, Estimates

from ..numbers import MINUS, short
from ..sections import DataDescription, Model, Section
from ..shooting_results import OWN, groups
from ..verdict import chosen_of, verdict_of
from .curves import curve_and_band, cut_heights, draw_density
from .style import (
    COLOURS,
    DARK,
    DASHED,
    GREY,
    HALF_PAGE,
    PALE,
    WIDTH,
    Styles,
    draw_truth,
    figure,
    frame,
    key_above,
    line,
    measured,
    most,
    panel_grid,
    patch,
    plain,
    truth_key,
    unmeasured_key,
    velocity_axis,
)

STRONG = 0.9
PAIRS = 4  # strongly correlated pairs in the caption
LETTERS = 0.053  # [inch] of a letter of a label
MARGIN = 0.42  # [inch] for the names of the groups
CELL = 0.3  # [inch], the largest
MOST = 50  # parameters that have room for a label
SMALL = 5  # [point], of labels with little room
LARGE = 25  # parameters, of which more have smaller labels


def strong_pairs(refined: Estimates) -> list[tuple[str, float]]:
    """Pairs of parameters whose |r| exceeds 0.9, with r; the strongest first."""
    r, read = refined.square(refined.correlation), refined.parameters
    places = np.argwhere(np.tril(np.nan_to_num(np.abs(r)) > STRONG, -1))
    pairs = [(f"{read[j].name} and {read[i].name}", float(r[i, j])) for i, j in places]
    return sorted(pairs, key=lambda pair: -abs(pair[1]))


def correlation_caption(model: Model, dataset: str) -> str:
    """Caption of a picture of correlations, with the strongest pairs."""
    refined = model.refined or Estimates()
    pairs = strong_pairs(refined)
    shown = [f"{names} ({r:+.2f})".replace("-", MINUS) for names, r in pairs[:PAIRS]]
    shown += [f"{len(pairs) - PAIRS} more pairs"] if len(pairs) > PAIRS else []
    sizes = refined.singular_values
    span = f"{short(max(sizes))} to {short(min(sizes))}" if len(sizes) else "none"
    return (
        f"Correlation of the parameters of {model.name} on {dataset}; framed above {STRONG:g} in "
        f"size: {', '.join(shown) or 'none'}. Grey names: not identified. Singular values of the "
        f"normal equations, scaled to ones on the diagonal: {span}."
    )


def fit_correlation(refined: Estimates, joints: Sequence[str]) -> Any:
    """Picture of the lower half of the correlation matrix of what shooting estimated.

    Strong entries have a frame. Rows and columns of parameters without a standard error are grey,
    names of those that are not identified, too.
    """
    read = refined.parameters
    labels = [e.parameter if e.block in OWN else e.name for e in read]
    few = len(read) <= MOST
    room, below = (
        LETTERS * max(map(len, shown or [""])) + 0.05 if few else 0.05
        for shown in (labels[1:], labels[:-1])
    )
    left, right = room + MARGIN, 0.75
    side = min(CELL * len(read), WIDTH - left - right, 6.0)
    width, height = left + side + right, side + below + 0.2
    picture = figure(height, width)
    picture.set_layout_engine("none")
    axis = picture.add_axes((left / width, (below + 0.1) / height, side / width, side / height))
    image = _cells(axis, refined.square(refined.correlation))
    _names(axis, read, labels)
    _groups(axis, read, joints, room + 0.1, side)
    tall = min(1.1, 0.7 * side)
    place = (width - 0.45, height - 0.3 - tall, 0.1, tall)
    bar = picture.add_axes([x / size for x, size in zip(place, 2 * (width, height), strict=True)])
    picture.colorbar(image, cax=bar, ticks=[-1, 0, 1])
    bar.set_title("r")
    return picture


def _cells(axis: Any, r: Array) -> Any:
    """Coloured cells below the diagonal, strong ones framed, unknown ones grey."""
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Rectangle

    D = len(r)
    below = np.tril(np.ones((D, D), dtype=bool), -1)
    colours = LinearSegmentedColormap.from_list("r", ["#D55E00", "#FFFFFF", "#0072B2"])
    unknown = np.where(below & ~np.isfinite(r), 1.0, np.nan)
    grey = LinearSegmentedColormap.from_list("grey", [PALE, PALE])
    axis.imshow(unknown, cmap=grey, interpolation="nearest")
    shown = np.where(below, r, np.nan)
    image = axis.imshow(shown, cmap=colours, vmin=-1, vmax=1, interpolation="nearest")
    for i, j in np.argwhere(below & (np.nan_to_num(np.abs(r)) > STRONG)):
        frame: Any = {"fill": False, "edgecolor": DARK, "linewidth": 1.1, "zorder": 3}
        axis.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **frame))
        if D <= LARGE:
            words = f"{r[i, j]:+.2f}".replace("0.", ".").replace("-", MINUS)
            axis.text(j, i, words, ha="center", va="center", fontsize=6, color="white")
    axis.set_xlim(-0.5, D - 0.5)
    axis.set_ylim(D - 0.5, -0.5)
    axis.spines[:].set_visible(False)
    return image


def _names(axis: Any, read: Sequence[Estimate], labels: Sequence[str]) -> None:
    """Names of the parameters at the left and below, grey where they are not identified."""
    D = len(read)
    if D > MOST:
        axis.set_xticks([])
        axis.set_yticks([])
        return
    words = list(map(plain, labels))
    size = 7 if D <= LARGE else SMALL
    axis.set_yticks(range(1, D), words[1:], fontsize=size)
    axis.set_xticks(range(D - 1), words[:-1], fontsize=size, rotation=90)
    axis.tick_params(length=0, pad=2)
    ticks = [*zip(axis.get_yticklabels(), read[1:], strict=True)]
    for label, e in (*ticks, *zip(axis.get_xticklabels(), read[:-1], strict=True)):
        if not e.identified:
            label.set_color(GREY)
            label.set_fontstyle("italic")


def _groups(
    axis: Any, read: Sequence[Estimate], joints: Sequence[str], left: float, side: float
) -> None:
    """Lines between the groups, and their names at the left and on the diagonal."""
    D, at = len(read), 0
    x = -0.5 - D * left / side
    for name, members in groups(read, joints):
        end = at + len(members)
        if end < D:
            axis.plot([-0.5, end - 0.5], [end - 0.5, end - 0.5], color=GREY, linewidth=0.7)
            axis.plot([end - 0.5, end - 0.5], [end - 0.5, D - 0.5], color=GREY, linewidth=0.7)
        axis.plot([x, x], [at - 0.4, end - 0.6], color=GREY, linewidth=0.8, clip_on=False)
        words = list(map(plain, name.split(", ")))
        small = SMALL if len(members) * side / D < LETTERS * max(map(len, words)) else 7
        look = {"rotation": 90, "ha": "right", "va": "center", "fontsize": small}
        axis.text(x - 0.06 * D / side, (at + end - 1) / 2, "\n".join(words), **look)
        at = end


_HIGH = 1.25  # of the largest friction shown
_PALE, _SPEEDS = 0.3, 0.12  # opacity of the band; height of the speeds' density, share of a panel
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


def fit_figure(friction: Friction, dataset: Dataset) -> Any:
    """Friction of each joint, and of each part that turns with several, over a data set's speeds.

    With the 95 % band where the friction was refined by shooting, and the truth where it is known.
    """
    w = speeds(dataset, EstimatedStates(dataset).by(INTEGRAL.states))
    grid, description = velocity_grid(w), dataset.mechanism
    curve, half = friction.curve(grid), _half_widths(friction, grid)
    truth = None if dataset.truth is None else steady_state(dataset.truth).curve(grid)
    picture, panels = panel_grid(len(description.friction_names), 2, 2.8, 0.4)
    for j, axes in enumerate(panels):
        _panel(axes, grid[:, j], curve[:, j], None if half is None else half[:, j])
        if truth is not None:
            axes.plot(grid[:, j], truth[:, j], color=DARK, linewidth=1, linestyle=DASHED)
        counts, edges = np.histogram(w[:, j], bins=_BINS, range=(grid[0, j], grid[-1, j]))
        draw_density(axes, edges, cut_heights(counts), _SPEEDS)
        axes.set_title(description.friction_names[j], loc="left")
        velocity, torque = description.friction_units[j], description.friction_torque_units[j]
        axes.set(xlabel=f"velocity [{velocity}/s]", ylabel=f"friction [{torque}]")
    key = {"fit to all data": line(COLOURS[0], linewidth=1.5)}
    if half is not None:
        key["95 % at all velocities"] = patch(COLOURS[0], _PALE)
    key |= truth_key(truth)
    key_above(picture, {**key, "how often each velocity occurred": patch(PALE)})
    return picture


def _half_widths(friction: Friction, grid: Array) -> Array | None:
    """Half-widths (V, n) of the simultaneous 95 % band, where the model's document has one."""
    refined = friction.provenance.refined
    if refined is None or refined.bands is None:
        return None
    bands = refined.bands
    halves = map(np.interp, grid.T, bands.velocity.T, bands.simultaneous.T)
    return np.stack(list(halves), axis=-1)


def _panel(axes: Any, w: Array, curve: Array, half: Array | None) -> None:
    end = _HIGH * float(np.nanmax(np.abs(curve), initial=0.0)) or 1.0
    velocity_axis(axes, w, (-end, end))
    if half is not None:
        axes.fill_between(w, curve - half, curve + half, color=COLOURS[0], alpha=_PALE, lw=0)
    axes.plot(w, curve, color=COLOURS[0], linewidth=1.5)


# --- The fit that the verdict names ---------------------------------------------------------------

ABREAST = 4  # joints at most
BAND = 0.25  # opacity
WIDEST = 2.5  # a rival's curve may be so many times as high as the model's with its band
RIVAL: Mapping[str, Any] = {"color": "#B5B5B5", "linewidth": 0.7}


def friction_of_the_choice(section: Section, styles: Styles) -> Any:
    """Friction over velocity, a panel for each joint: the model that the verdict names, and rivals.

    With its 95 % band, by shooting or by what leaving out each fold changes. Rivals are the fits by
    its recipe and by that of the verdict. None where no model has a friction curve.
    """
    chosen, data = chosen_of(section), section.description
    if chosen is None or not np.isfinite(chosen.curves[-1]).any():
        return None
    recipes = {chosen.recipe, verdict_of(section).recipe}
    rivals = [m for m in section.of_role("fitted") if m.recipe in recipes and m is not chosen]
    joints, colour = len(data.joints), styles[chosen.label].colour
    columns = joints if joints <= 3 else min(-(-joints // 2), ABREAST)
    height = 2.3 if joints == columns else 1.25
    picture, axes = panel_grid(joints, columns, height, 0.7, HALF_PAGE)
    for joint, axis in enumerate(axes):
        _choice_panel(axis, chosen, rivals, data, joint, colour)
        axis.set_title(plain(data.joints[joint]))
        axis.locator_params(axis="x", nbins=3 if columns == ABREAST else 5)
        if joint % columns == 0:
            axis.set_ylabel(f"friction [{data.torque_units[joint]}]")
    key = {chosen.curve_name: line(colour, linewidth=1.8)}
    if np.isfinite(curve_and_band(chosen, data, 0)[2]).any():
        key["its 95 % band"] = patch(colour, BAND)
    if rivals:
        key["other models"] = line(**RIVAL)
    key_above(picture, key | truth_key(data.truth) | unmeasured_key(data))
    picture.supxlabel(f"velocity [{data.velocity_unit}]")
    return picture


def _choice_panel(
    axis: Any,
    chosen: Model,
    rivals: Sequence[Model],
    data: DataDescription,
    joint: int,
    colour: str,
) -> None:
    """A joint's panel, as high as the model's band where the joint moved, and the truth."""
    w, x, curve, half = data.velocity[:, joint], *curve_and_band(chosen, data, joint)
    inside = measured(x, data, joint)
    heights = [(np.abs(curve) + np.nan_to_num(half))[inside]]
    heights += [] if data.truth is None else [np.abs(data.truth[:, joint])]
    high = max(float(np.max(h, initial=0.0)) for h in heights)
    others = [m.curves[-1][:, joint] for m in rivals]
    if others:
        high = max(high, min(most([np.abs(c) for c in others]), WIDEST * high))
    high = 1.08 * high or 1.0
    frame(axis, w, data, joint, high)
    for other in others:
        axis.plot(w, other, **RIVAL)
    axis.fill_between(x, curve - half, curve + half, color=colour, alpha=BAND, linewidth=0)
    axis.plot(x, curve, color=colour, linewidth=1.8)
    draw_truth(axis, data, joint)
