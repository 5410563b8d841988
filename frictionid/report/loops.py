"""Loops of friction over velocity: which models have memory, how late they are, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.report.numbers import either, mean_sd, percent
from frictionid.report.sections import Model, Section
from frictionid.report.tables import Column, Table, line, text_columns

KINDS = {"reversing": "reversing", "offset": "never reversing"}
SIGNIFICANT = 2.0  # standard deviations over the folds
ROUNDING = 1e-9
LATEST = 1 / 12  # of a period: what closes later than that is no lag
NARROW = 0.01  # width of a loop, in units of the torque's size, below which it is none


class Loop(NamedTuple):
    """One joint's loop on one motion: velocity (T,), torque (F + 1, T), width and lag (F + 1,)."""

    joint: int
    kind: str
    frequency: float
    velocity: Array
    torque: Array
    width: Array
    lag: Array

    @property
    def folds(self) -> slice:
        """Where the folds stand; the friction of all data is last."""
        return slice(0, max(len(self.width) - 1, 1))

    @property
    def share(self) -> float:
        """Mean width over the folds in units of the torque's RMS."""
        own = self.torque[self.folds]
        width = abs(self.width[self.folds].mean())
        return float(width / max(np.sqrt(np.mean(own**2)), 1e-300))

    @property
    def verdict(self) -> str:
        """What the loop says: "late", "early", "open", "closed" or "scatter".

        open : wider than 1 % of the torque and two standard deviations over the folds; late or
        early : a lag of the velocity closes it, beyond two standard deviations and less than a
        twelfth of the period; scatter : wider than 1 %, but inside the scatter of the folds
        """
        width, lag = self.width[self.folds], self.lag[self.folds]
        if self.share < NARROW:
            return "closed"
        if abs(width.mean()) <= SIGNIFICANT * _sd(width):
            return "scatter"
        if np.isfinite(lag).all():
            late = SIGNIFICANT * _sd(lag) < abs(lag.mean()) < LATEST / self.frequency
            return ("late" if lag.mean() > 0 else "early") if late else "open"
        return "open"


def _sd(values: Array) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else 0.0


def loops_of(model: Model, joint: int, kind: str) -> list[Loop]:
    """Loops of a model's joint on one kind of motion, from slow to fast."""
    own = [
        Loop(
            *(int(d["joint"]), str(d["kind"]), float(d["frequency"])),
            *(np.asarray(d[key], dtype=float) for key in ("velocity", "torque", "width", "lag")),
        )
        for d in model.loops
        if d["joint"] == joint and d["kind"] == kind
    ]
    return sorted(own, key=lambda loop: loop.frequency)


def middle(loops: Sequence[Loop]) -> Loop:
    """The loop at the middle one of the frequencies."""
    return loops[len(loops) // 2]


def has_memory(model: Model) -> bool:
    """Whether any of a model's loops is open at all: friction of the velocity alone has none."""
    return any(
        bool((np.abs(np.asarray(d["width"], dtype=float)) > ROUNDING * _size(d["torque"])).any())
        for d in model.loops
    )


def _size(torque: object) -> float:
    return float(np.abs(np.asarray(torque, dtype=float)).max())


def with_loops(section: Section) -> list[Model]:
    """Fitted and given models of a section that have loops to show."""
    return [model for model in section.of_role("fitted", "given") if model.loops]


def with_memory(section: Section) -> list[Model]:
    """Fitted and given models of a section whose loops are open."""
    return [model for model in with_loops(section) if has_memory(model)]


def loop_table(section: Section) -> Table | None:
    """Widths and lags of all loops, and what they say; None where no model has memory."""
    models = with_memory(section)
    if not models:
        return None
    models += [model for model in section.of_role("truth") if has_memory(model)]
    data = section.description
    columns = [*text_columns("model", "joint"), Column("Hz")]
    unit = either([f"m{unit}" for unit in data.torque_units])
    columns += [Column(f"{text} width [{unit}]") for text in KINDS.values()]
    columns += [Column(f"{KINDS['offset']} lag [ms]"), Column("share of torque")]
    columns += text_columns("verdict")
    lines = []
    for model in models:
        for joint, name in enumerate(data.joints):
            pairs = [loops_of(model, joint, kind) for kind in KINDS]
            for loops in zip(*pairs, strict=True):
                cells = [model.name, name, f"{loops[0].frequency:.3g}"]
                cells += [mean_sd(1e3 * loop.width[loop.folds]) for loop in loops]
                offset = loops[-1]
                cells += [
                    mean_sd(1e3 * offset.lag[offset.folds]),
                    percent(offset.share),
                    offset.verdict,
                ]
                lines.append(line(cells, model.name))
    caption = (
        f"{section.dataset}: loops of friction over velocity, mean ± standard deviation over the "
        "folds. Width: torque at rising less that at falling speed, mean over the speeds. Lag: how "
        "much later velocity must be taken for the loop to close best. Share and verdict: of "
        "motion that never reverses. Closed: below 1 % of the torque. Scatter: inside that of the "
        "folds. Late, early: a lag closes the loop, as a torque clock that is off would. Open: no "
        "lag closes it."
    )
    return Table(caption, f"loops-{section.dataset}", tuple(columns), tuple(lines))
