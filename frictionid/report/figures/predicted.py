"""Predicted over measured motion of one model, from a table of predictions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from frictionid.report.figures.style import COLOURS, figure, key_above, line, plain

MEASURED = "#BDBDBD"


def predicted_figure(table: pd.DataFrame, joints: Sequence[str], units: Sequence[str]) -> Any:
    """Angles over time, a row for each joint: measured, and predicted from each start.

    table : of `predicted_motion`, of one recording
    """
    picture = figure(0.55 + 1.5 * len(joints))
    axes = picture.subplots(len(joints), 1, sharex=True, squeeze=False)[:, 0]
    for j, axis in enumerate(axes):
        for _, own in table.groupby("start_s", sort=False):
            measured = own[f"measured_q{j + 1}"]
            axis.plot(own["time_s"], measured, color=MEASURED, linewidth=4, zorder=1)
            axis.plot(own["time_s"], own[f"q{j + 1}"], color=COLOURS[0], linewidth=1.1)
        axis.set_ylabel(f"{plain(joints[j])} [{units[j]}]")
        axis.margins(x=0)
    axes[-1].set_xlabel(f"time [s], {plain(str(table['recording'].iloc[0]))}")
    keys = {"measured": line(MEASURED, linewidth=4), "predicted": line(COLOURS[0])}
    key_above(picture, keys)
    return picture
