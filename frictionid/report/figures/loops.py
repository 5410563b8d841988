"""Pictures of loops of friction over velocity along sinusoids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import (
    DARK,
    DASHED,
    GREY,
    ZERO,
    Style,
    figure,
    key_above,
    line,
    plain,
    side_by_side,
)
from frictionid.report.memory import KINDS, Loop, has_memory, loops_of, middle, with_loops
from frictionid.report.sections import Model, Section

COLUMNS = 4  # models side by side; more go to another picture
REST = 1e-6  # of the largest velocity: there sgn(w) is rounding
RESOLVED = 0.01  # of the largest velocity: closer samples on both sides of a reversal are joined
TONES = (0.55, 0.0, -0.45)  # towards white, and towards black: from slow to fast


def loop_pictures(section: Section, styles: Mapping[str, Style]) -> dict[str, list[Any]]:
    """Pictures of the loops by recipe: a column for each model, rows of joints and motions."""
    models = with_loops(section)
    by_recipe = {m.recipe: [o for o in models if o.recipe == m.recipe] for m in models}
    return {
        recipe: [_picture(section, part, styles) for part in side_by_side(columns, COLUMNS)]
        for recipe, columns in by_recipe.items()
    }


def _picture(section: Section, columns: Sequence[Model], styles: Mapping[str, Style]) -> Any:
    data = section.description
    rows = [(joint, kind) for joint in range(len(data.joints)) for kind in KINDS]
    picture = figure(0.6 + 1.5 * len(rows))
    axes = picture.subplots(len(rows), len(columns), squeeze=False, sharey="row", sharex="row")
    for r, (joint, kind) in enumerate(rows):
        for axis, model in zip(axes[r], columns, strict=True):
            _panel(axis, loops_of(model, joint, kind), styles[model.label].colour)
            _truth(axis, section, joint, kind)
        own = [loop for model in columns for loop in loops_of(model, joint, kind)]
        tones = ", ".join(dict.fromkeys(f"{loop.frequency:.3g}" for loop in own))
        name = f"{plain(data.joints[joint])}, {KINDS[kind]}"
        axes[r, 0].set_ylabel(f"{name}\n{tones} Hz  [{data.torque_units[joint]}]", fontsize=7)
    for axis, model in zip(axes[0], columns, strict=True):
        axis.set_title(plain(model.label), color=styles[model.label].colour, weight="bold")
    key_above(picture, _key(bool(section.of_role("truth")) or data.truth is not None))
    picture.supxlabel(f"velocity [{data.velocity_unit}]", fontsize=8)
    return picture


def _panel(axis: Any, loops: Sequence[Loop], colour: str) -> None:
    axis.locator_params(nbins=5)
    if not loops:
        return
    shown = middle(loops)
    if shown.kind == "reversing":
        axis.axhline(0, **ZERO)
    for torque in shown.torque[shown.folds]:
        axis.plot(*_closed(shown.velocity, torque), color=colour, linewidth=0.4, alpha=0.35)
    for loop, tone in zip(loops, _tones(len(loops)), strict=True):
        mean = loop.torque[loop.folds].mean(axis=0)
        axis.plot(*_closed(loop.velocity, mean), color=_mixed(colour, tone), linewidth=1.3)


def _truth(axis: Any, section: Section, joint: int, kind: str) -> None:
    """The true friction: its loop where it has one, else its curve."""
    style = {"color": DARK, "linewidth": 0.9, "linestyle": DASHED, "zorder": 4}
    for model in section.of_role("truth"):
        own = loops_of(model, joint, kind)
        if own:
            w, torque = middle(own).velocity, middle(own).torque[-1]
            order = np.argsort(w)  # there and back on one line, dashes would fill each other
            line = _closed(w, torque) if has_memory(model) else _broken(w[order], torque[order])
            axis.plot(*line, **style)
            return
    data = section.description
    if data.truth is not None:
        low, high = axis.get_xlim()
        w = data.velocity[:, joint]
        inside = (w >= low) & (w <= high)
        axis.plot(*_broken(w[inside], data.truth[inside, joint]), **style)


def _closed(w: Array, torque: Array) -> tuple[Array, Array]:
    """The closed loop, open at reversals that no sample resolves: friction jumps there.

    >>> _closed(np.array([1.0, 3.0, 2.0]), np.ones(3))[0]
    array([1., 3., 2., 1.])
    >>> _closed(np.array([-2.0, 2.0]), np.ones(2))[0]
    array([-2., nan,  2., nan, -2.])
    """
    return _broken(np.append(w, w[0]), np.append(torque, torque[0]))


def _broken(w: Array, torque: Array) -> tuple[Array, Array]:
    """The line, with a gap between samples that are not close and have no common direction."""
    most = np.abs(w).max()
    side = np.where(np.abs(w) < REST * most, 0.0, np.sign(w))
    far = np.abs(np.diff(w)) > RESOLVED * most
    jumps = np.flatnonzero(far & (side[1:] != side[:-1])) + 1
    return np.insert(w, jumps, np.nan), np.insert(torque, jumps, np.nan)


def _tones(count: int) -> list[float]:
    if count == 1:
        return [0.0]
    return [float(t) for t in np.interp(np.linspace(0, 2, count), (0, 1, 2), TONES)]


def _mixed(colour: str, tone: float) -> Any:
    """A colour with so much white, or, for negative tones, black."""
    from matplotlib.colors import to_rgb

    base, end = np.array(to_rgb(colour)), 1.0 if tone > 0 else 0.0
    return tuple(base + abs(tone) * (end - base))


def _key(truth: bool) -> dict[str, Any]:
    slow, between, fast = (line(_mixed(GREY, tone), linewidth=1.5) for tone in TONES)
    key = {"slow": slow, "middle frequency": between, "fast": fast}
    key["each fold, middle frequency"] = line(GREY, linewidth=0.5, alpha=0.6)
    return {**key, "truth": line(DARK, DASHED, 1)} if truth else key
