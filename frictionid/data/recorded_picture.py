"""Recordings as a notebook shows them: a table, and angles and torques over time.

A data set calls these functions to show itself, so that none of its classes is named here.
"""

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from frictionid.arrays import Array, usual_step
from frictionid.pictures import COLOURS, figure

from .signals import GAP, Signal, clock_of, run_edges, usual_intervals

_SHOWN = 20  # recordings in a table
_QUIET = 0.5  # [s] at least
_WINDOW = 0.2  # [s] in which a joint at rest hardly moves
_GAP, _REST, _LOST = "#F4C7B0", "#ECECEC", "#C43B1D"


def losses_of(time: Array) -> tuple[Array, Array]:
    """Gaps (k, 2) [s] of a clock, and times [s] after which single samples are missing.

    Gaps are longer than five usual intervals.

    >>> losses_of(np.delete(np.arange(100) * 0.01, [20, *range(50, 60)]))
    (array([[0.49, 0.6 ]]), array([0.19]))
    """
    step = np.diff(time)
    ratio = step / usual_intervals(step)
    at = np.flatnonzero(ratio > GAP)
    lost = np.flatnonzero((ratio > 1.5) & (ratio <= GAP))
    return np.stack([time[at], time[at + 1]], axis=1), time[lost]


def quiet_spans(angle: Signal, slow: Array) -> Array:
    """Spans (k, 2) [s] of half a second or more in which no joint is faster than slow (n,)."""
    time, value = angle.time, angle.value
    size = max(int(round(_WINDOW / usual_step(time))), 1) + 1
    moved = maximum_filter1d(value, size, axis=0) - minimum_filter1d(value, size, axis=0)
    still = np.asarray((moved < slow * _WINDOW).all(axis=1))
    still[1:] &= np.diff(time) < _WINDOW  # a gap is no rest
    first, behind = run_edges(still)
    spans = np.stack([time[first], time[behind - 1]], axis=1)
    return spans[np.ptp(spans, axis=1) >= _QUIET]


def dataset_html(dataset: Any) -> str:
    """Table of the recordings of a data set."""
    recordings = dataset.recordings
    head = ("recording", "seconds", "samples", "rate [Hz]", "dropped", "gaps", "at rest [s]")
    lines = ["".join(f"<th>{name}</th>" for name in head)]
    for recording in recordings[:_SHOWN]:
        clock = clock_of([recording.angle.time])
        rest = np.ptp(quiet_spans(recording.angle, dataset.scales.slow), axis=1).sum()
        cells = (
            *(escape(recording.name), f"{clock.duration:.3g}", clock.samples, f"{clock.rate:.4g}"),
            *(clock.dropped, clock.gaps, f"{rest:.2g}"),
        )
        lines.append("".join(f"<td>{cell}</td>" for cell in cells))
    rows = "".join(f"<tr>{line}</tr>" for line in lines)
    left = len(recordings) - _SHOWN
    others = f"<p>and {left} more</p>" if left > 0 else ""
    said = f"{dataset!r}, {dataset.mechanism.kind}"
    return f"<p>{escape(said)}</p><table>{rows}</table>{others}"


def recorded_figure(dataset: Any, recordings: Sequence[Any]) -> Any:
    """Angles and torques over time, a column for each recording.

    Gaps are red, dropped samples red ticks, stretches at rest grey.
    """
    rows = [("angle", dataset.mechanism.position_units), ("torque", dataset.mechanism.torque_units)]
    rows = rows if any(r.torque.value.any() for r in recordings) else rows[:1]
    picture = figure(1.0 + 1.6 * len(rows))
    axes = picture.subplots(len(rows), len(recordings), sharex="col", sharey="row", squeeze=False)
    for column, recording in zip(axes.T, recordings, strict=True):
        for axis, (name, _) in zip(column, rows, strict=True):
            _panel(axis, recording, getattr(recording, name))
            for start, stop in quiet_spans(recording.angle, dataset.scales.slow):
                axis.axvspan(start, stop, color=_REST, linewidth=0)
        column[0].set_title(recording.name.replace("$", r"\$")[:30], loc="left")
        column[-1].set_xlabel("time [s]")
    for axis, (name, units) in zip(axes[:, 0], rows, strict=True):
        axis.set_ylabel(f"{name} [{', '.join(dict.fromkeys(units))}]")
    picture.legend(handles=list(_key(dataset, recordings)), loc="outside upper right", ncols=6)
    return picture


def _panel(axis: Any, recording: Any, signal: Signal) -> None:
    """Lines of all joints that have a signal, broken at gaps."""
    gaps, dropped = losses_of(recording.angle.time)
    ends = np.concatenate([gaps[:, 0], [np.inf]])
    piece = np.searchsorted(ends, signal.time)
    style = "steps-post" if signal.hold == "previous" else "default"
    for j, column in enumerate(signal.value.T):
        if not column.any():
            continue
        for k in np.unique(piece):
            part = piece == k
            colour = COLOURS[j % len(COLOURS)]
            axis.plot(signal.time[part], column[part], color=colour, drawstyle=style, linewidth=0.8)
    for start, stop in gaps:
        axis.axvspan(start, stop, color=_GAP, linewidth=0)
    if len(dropped):
        top, across = np.full(len(dropped), 0.98), axis.get_xaxis_transform()
        axis.plot(dropped, top, "|", color=_LOST, transform=across)


def _key(dataset: Any, recordings: Sequence[Any]) -> Iterator[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    for j, name in enumerate(dataset.mechanism.joints):
        yield Line2D([], [], color=COLOURS[j % len(COLOURS)], label=name)
    slow = dataset.scales.slow
    if any(len(quiet_spans(r.angle, slow)) for r in recordings):
        yield Patch(color=_REST, label="at rest")
    gaps, dropped = zip(*(losses_of(r.angle.time) for r in recordings), strict=True)
    if any(map(len, gaps)):
        yield Patch(color=_GAP, label="gap")
    if any(map(len, dropped)):
        yield Line2D([], [], color=_LOST, marker="|", linestyle="", label="dropped sample")
