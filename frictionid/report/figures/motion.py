"""Predicted over measured motion, from starts that no fit has seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import Look, figure, key_above, plain
from frictionid.report.load import Entry

MEASURED = "#BDBDBD"


def motions(
    entries: Sequence[Entry],
    dataset: str,
    about: Mapping[str, Any],
    looks: Mapping[str, Look],
    beside: str = "",
) -> Any:
    """Angles of a few example motions over time, a column for each; None where there are none.

    beside : words below the time axis
    """
    examples = {_start(m): m for e in entries for m in e.motions if m["dataset"] == dataset}
    if not examples:
        return None
    joints = range(len(about["joints"]))
    picture = figure(0.65 + 1.5 * len(joints))
    axes = picture.subplots(len(joints), len(examples), sharex="col", squeeze=False)
    for c, (start, example) in enumerate(examples.items()):
        drawn = [(e, m) for e in entries for m in e.motions if _start(m) == start]
        for joint in joints:
            _panel(axes[joint, c], example, drawn, joint, looks)
        axes[0, c].set_title(_title(example), fontsize=7, loc="left")
    for joint in joints:
        axes[joint, 0].set_ylabel(f"{about['joints'][joint]} [{about['angle_unit']}]")
    words = "time since the start of the prediction [s]"
    picture.supxlabel(f"{words}{plain(beside)}", fontsize=8)
    _key(picture, entries, looks)
    return picture


def _start(motion: Mapping[str, Any]) -> tuple[str, str, float]:
    return motion["dataset"], motion["recording"], float(motion["start_s"])


def _title(motion: Mapping[str, Any]) -> str:
    name = str(motion["recording"]).rpartition("/")[2]
    name = name if len(name) <= 24 else f"…{name[-23:]}"
    return plain(f"{name} from {float(motion['start_s']):.2f} s")


def _panel(
    axis: Any,
    example: Mapping[str, Any],
    drawn: Sequence[tuple[Entry, Mapping[str, Any]]],
    joint: int,
    looks: Mapping[str, Look],
) -> None:
    measured = _series(example["measured"])[:, joint]
    axis.plot(_series(example["time"]), measured, color=MEASURED, linewidth=4, zorder=1)
    for entry, motion in drawn:
        look = looks[entry.label]
        predicted = _series(motion["predicted"])[:, joint]
        time = _series(motion["time"])
        axis.plot(time, predicted, color=look.colour, linestyle=look.line, linewidth=1.1)
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    room = max(0.6 * (high - low), 0.3)  # predictions that leave it have diverged
    lines = [_series(motion["predicted"])[:, joint] for _, motion in drawn]
    reach = np.concatenate([*lines, measured])
    reach = reach[np.isfinite(reach)]
    axis.set_ylim(
        max(low - room, float(reach.min()) - 0.05 * room),
        min(high + room, float(reach.max()) + 0.05 * room),
    )
    axis.margins(x=0)


def _series(values: Any) -> Array:
    """Numbers of a JSON list; what is not finite leaves a gap."""
    array = np.asarray(values, dtype=float)
    return np.where(np.isfinite(array), array, np.nan)


def _key(picture: Any, entries: Sequence[Entry], looks: Mapping[str, Look]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=MEASURED, linewidth=4)]
    handles += [
        Line2D([], [], color=looks[e.label].colour, linestyle=looks[e.label].line) for e in entries
    ]
    key_above(picture, handles, ["measured", *(entry.label for entry in entries)])
