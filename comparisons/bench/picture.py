"""The ratios as bars, what is asked for as marks, the spread over rounds as whiskers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from measure import Row

from frictionid.report.figures.style import COLOURS, DARK, GREY, drawn, figure, marker, patch


def picture(rows: Sequence[Row]) -> Any:
    """A figure of all rows that are drawn."""
    return drawn(lambda: _bars([r for r in rows if r.case.drawn]))


def _bars(rows: Sequence[Row]) -> Any:
    made = figure(0.9 + 0.27 * len(rows))
    axes = made.subplots()
    place = np.arange(len(rows))[::-1]
    ratio = np.array([r.ratio for r in rows])
    spread = np.array([[r.ratio - r.ratios.min(), r.ratios.max() - r.ratio] for r in rows]).T
    colours = [COLOURS[1] if r.holds is False else COLOURS[0] for r in rows]
    # from one on: to the right ours is faster
    axes.barh(place, ratio - 1.0, left=1.0, color=colours, height=0.62, zorder=2)
    axes.errorbar(ratio, place, xerr=spread, fmt="none", ecolor=DARK, elinewidth=0.8, capsize=2)
    for y, row in zip(place, rows, strict=True):
        if row.case.bar is not None:
            axes.plot([row.case.bar] * 2, [y - 0.4, y + 0.4], color="black", linewidth=1.6)
        text = f" {row.ratio:.3g} "
        axes.annotate(text, (max(row.ratios.max(), 1.0), y), va="center", fontsize=7)
    axes.set_xscale("log")
    axes.axvline(1.0, color=GREY, linewidth=0.8)
    axes.set_yticks(place, [f"{r.case.name}\nbeside {r.case.peer.what}" for r in rows], fontsize=6)
    axes.set_xlabel("time of the other way over ours")
    axes.margins(x=0.12, y=0.01)
    axes.grid(axis="x", color="#EEEEEE", linewidth=0.6, zorder=0)
    key = {
        "as asked for, or nothing asked": patch(COLOURS[0]),
        "less than asked for": patch(COLOURS[1]),
        "asked for": marker("black", "|", 9),
    }
    made.legend(key.values(), key.keys(), loc="outside upper center", ncols=3)
    return made
