"""The lowest score so far over the trials: a panel for each unit, a colour for each sampler."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.search_space import Objective
from frictionid.comparison.tuning.studies import Found
from frictionid.files import write_bytes
from frictionid.report.figures.style import COLOURS, drawing, figure, key_above, plain, rendered

COLUMNS = 3


def write_progress(path: Path, found: Sequence[Found], objective: Objective) -> str:
    """Name of the picture, written in all formats."""
    with drawing():
        for kind, content in rendered(progress(found, objective)).items():
            write_bytes(path.with_suffix(f".{kind}"), content)
    return path.name


def progress(found: Sequence[Found], objective: Objective) -> Any:
    """The picture of all studies."""
    from matplotlib.lines import Line2D

    units = [list(own) for _, own in groupby(found, key=lambda f: f.unit.title)]
    columns = min(COLUMNS, len(units))
    rows = -(-len(units) // columns)
    picture = figure(0.6 + 1.9 * rows)
    axes = picture.subplots(rows, columns, squeeze=False)
    samplers = list(dict.fromkeys(f.sampler for f in found))
    colours = dict(zip(samplers, COLOURS, strict=False))
    for axis in axes.flat[len(units) :]:
        axis.set_axis_off()
    for axis, own in zip(axes.flat, units, strict=False):
        for f in own:
            whole = f.fold is None
            axis.step(
                np.arange(1, len(f.trials) + 1),
                _lowest(f),
                where="post",
                color=colours[f.sampler],
                linewidth=1.5 if whole else 0.5,
                alpha=1.0 if whole else 0.4,
                zorder=3 if whole else 2,
            )
        axis.set_title(plain(own[0].unit.title), fontsize=7, loc="left")
        axis.locator_params(axis="x", integer=True, nbins=6)
    unit = "rad" if objective.horizon is not None else "rad/s"
    picture.supxlabel("trials", fontsize=8)
    picture.supylabel(f"{objective.words} [{unit}]", fontsize=7)
    handles = [Line2D([], [], color=colours[name]) for name in samplers]
    key_above(picture, handles, samplers)
    return picture


def _lowest(found: Found) -> Array:
    values = np.array([t.value for t in found.trials])
    return np.minimum.accumulate(np.where(np.isnan(values), np.inf, values))
