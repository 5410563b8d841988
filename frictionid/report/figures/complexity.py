"""Error of prediction against the complexity of the models, with the region of the best one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from frictionid.report.figures.panels import plain_logarithm
from frictionid.report.figures.style import DARK, DASHED, GRID, Style, figure, key_above, marker
from frictionid.report.numbers import seconds
from frictionid.report.verdict import Verdict


def error_over_complexity(verdict: Verdict, styles: Mapping[str, Style]) -> Any:
    """Each model's error in the folds over its effective parameters; None with fewer than two.

    Points are means over the folds, bars reach from the lowest to the highest fold. The band is
    the region of practical equivalence above the best model.
    """
    own = [c for c in verdict.candidates if c.is_finite and np.isfinite(c.complexity)]
    if len(own) < 2 or not np.isfinite(verdict.region):
        return None
    picture = figure(2.7)
    axis = picture.subplots()
    best = min(c.error for c in own)
    axis.axhspan(best, best + verdict.region, color=DARK, alpha=0.12, linewidth=0)
    axis.axhline(best, color=DARK, linewidth=0.8, linestyle=DASHED)
    for candidate in own:
        place, colour = candidate.complexity, styles[candidate.model.label].colour
        ends = candidate.errors.min(), candidate.errors.max()
        axis.plot([place, place], ends, color=colour, linewidth=1.0, alpha=0.6)
        face = "white" if candidate.implausible else colour
        shape = "*" if candidate.name == verdict.recommended else "o"
        axis.plot(place, candidate.error, shape, color=colour, markerfacecolor=face, markersize=8)
    axis.set_xscale("symlog", linthresh=1.0)  # models without friction have no parameters
    axis.xaxis.set_major_formatter("{x:g}")
    axis.set_xlim(left=-0.3)
    plain_logarithm(axis)
    axis.set_xlabel("effective parameters")
    axis.set_ylabel(f"error after {seconds(verdict.horizon)} [{verdict.unit}]")
    axis.grid(**GRID)
    labels = dict.fromkeys(c.model.label for c in own)
    key = {label: marker(styles[label].colour, "o", 5) for label in labels}
    key_above(picture, key, 0.8)
    return picture
