"""Loops of friction over velocity: pictures, a table, and what they say of memory in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.report.figures.style import DARK, GREY, Look, figure, key_above, plain
from frictionid.report.load import Entry, Section
from frictionid.report.numbers import NOTHING, decimals, fixed, listed, percent, short
from frictionid.report.tables import Cell, Column, Line, Table
from frictionid.report.text import named

COLUMNS = 4  # models side by side; more go to another picture
TONES = (0.55, 0.0, -0.45)  # towards white, and towards black: from slow to fast
KINDS = {"reversing": "reversing", "offset": "never reversing"}
SURE = 2.0  # standard deviations over the folds
ROUNDING = 1e-9
LATEST = 1 / 12  # of a period: what closes later than that is no lag
NARROW = 0.01  # width of a loop, in units of the torque's size, below which it is none


class Shown(NamedTuple):
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


def loops_of(entry: Entry, joint: int, kind: str) -> list[Shown]:
    """Loops of an entry's joint on one kind of motion, from slow to fast."""
    own = [
        Shown(
            *(int(d["joint"]), str(d["kind"]), float(d["frequency"])),
            *(np.asarray(d[key], dtype=float) for key in ("velocity", "torque", "width", "lag")),
        )
        for d in entry.loops
        if d["joint"] == joint and d["kind"] == kind
    ]
    return sorted(own, key=lambda shown: shown.frequency)


def middle(loops: Sequence[Shown]) -> Shown:
    """The loop at the middle one of the frequencies."""
    return loops[len(loops) // 2]


def shown_of(section: Section) -> list[Entry]:
    """Fitted and given entries of a section that have loops to show."""
    return [entry for entry in section.of_role("fitted", "given") if entry.loops]


def remembers(entry: Entry) -> bool:
    """Whether any of an entry's loops is open at all: friction of the velocity alone has none."""
    widths = [np.asarray(d["width"], dtype=float) for d in entry.loops]
    sizes = [np.abs(np.asarray(d["torque"], dtype=float)).max() for d in entry.loops]
    return any(
        bool((np.abs(width) > ROUNDING * size).any())
        for width, size in zip(widths, sizes, strict=True)
    )


def remembering(section: Section) -> list[Entry]:
    """Fitted and given entries of a section whose loops are open."""
    return [entry for entry in shown_of(section) if remembers(entry)]


# --- Pictures -------------------------------------------------------------------------------------


def loop_pictures(
    section: Section, about: Mapping[str, Any], looks: Mapping[str, Look]
) -> list[tuple[str, Any]]:
    """Recipe and picture of the loops: a column for each model, rows of joints and motions."""
    out = []
    for recipe in dict.fromkeys(entry.recipe for entry in shown_of(section)):
        own = [entry for entry in shown_of(section) if entry.recipe == recipe]
        for i in range(0, len(own), COLUMNS):
            out.append((recipe, _picture(section, own[i : i + COLUMNS], about, looks)))
    return out


def _picture(
    section: Section, columns: Sequence[Entry], about: Mapping[str, Any], looks: Mapping[str, Look]
) -> Any:
    joints = range(len(about["joints"]))
    rows = [(joint, kind) for joint in joints for kind in KINDS]
    picture = figure(0.6 + 1.5 * len(rows))
    axes = picture.subplots(len(rows), len(columns), squeeze=False, sharey="row", sharex="row")
    truth = section.of_role("truth")
    for r, (joint, kind) in enumerate(rows):
        for c, entry in enumerate(columns):
            _panel(axes[r, c], loops_of(entry, joint, kind), looks[entry.label])
            _true(axes[r, c], truth, joint, kind, about)
        own = [loop for e in columns for loop in loops_of(e, joint, kind)]
        tones = ", ".join(dict.fromkeys(f"{loop.frequency:.3g}" for loop in own))
        axes[r, 0].set_ylabel(
            f"{plain(about['joints'][joint])}, {KINDS[kind]}\n{tones} Hz  [{about['torque_unit']}]",
            fontsize=7,
        )
    for axis, entry in zip(axes[0], columns, strict=True):
        axis.set_title(plain(entry.label), color=looks[entry.label].colour, weight="bold")
    _key(picture, bool(truth) or about["truth"] is not None)
    picture.supxlabel(f"velocity [{about['angle_unit']}/s]", fontsize=8)
    return picture


def _panel(axis: Any, loops: Sequence[Shown], look: Look) -> None:
    axis.locator_params(nbins=5)
    if not loops:
        return
    shown = middle(loops)
    if shown.kind == "reversing":
        axis.axhline(0, color="#BBBBBB", linewidth=0.5, zorder=1)
    for line in shown.torque[shown.folds]:
        axis.plot(*_closed(shown.velocity, line), color=look.colour, linewidth=0.4, alpha=0.35)
    for loop, tone in zip(loops, _tones(len(loops)), strict=True):
        mean = loop.torque[loop.folds].mean(axis=0)
        axis.plot(*_closed(loop.velocity, mean), color=_mixed(look.colour, tone), linewidth=1.3)


def _true(
    axis: Any,
    truth: Sequence[Entry],
    joint: int,
    kind: str,
    about: Mapping[str, Any],
) -> None:
    """The true friction: its loop where it has one, else its curve."""
    style = {"color": DARK, "linewidth": 0.9, "linestyle": (0, (4, 1.5)), "zorder": 4}
    for entry in truth:
        own = loops_of(entry, joint, kind)
        if own:
            w, torque = middle(own).velocity, middle(own).torque[-1]
            order = np.argsort(w)  # there and back on one line, dashes would fill each other
            line = _closed(w, torque) if remembers(entry) else (w[order], torque[order])
            axis.plot(*line, **style)
            return
    if about["truth"] is not None:
        low, high = axis.get_xlim()
        w = np.asarray(about["velocity"], dtype=float)[:, joint]
        inside = (w >= low) & (w <= high)
        axis.plot(w[inside], np.asarray(about["truth"], dtype=float)[inside, joint], **style)


def _closed(x: Array, y: Array) -> tuple[Array, Array]:
    return np.append(x, x[0]), np.append(y, y[0])


def _tones(count: int) -> list[float]:
    if count == 1:
        return [0.0]
    return [float(t) for t in np.interp(np.linspace(0, 2, count), (0, 1, 2), TONES)]


def _mixed(colour: str, tone: float) -> Any:
    """A colour with so much white, or, for negative tones, black."""
    from matplotlib.colors import to_rgb

    base, end = np.array(to_rgb(colour)), 1.0 if tone > 0 else 0.0
    return tuple(base + abs(tone) * (end - base))


def _key(picture: Any, truth: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=_mixed(GREY, tone), linewidth=1.5) for tone in TONES]
    labels = ["slow", "middle frequency", "fast"]
    handles.append(Line2D([], [], color=GREY, linewidth=0.5, alpha=0.6))
    labels.append("each fold, middle frequency")
    if truth:
        handles.append(Line2D([], [], color=DARK, linewidth=1, linestyle=(0, (4, 1.5))))
        labels.append("truth")
    key_above(picture, handles, labels)


# --- Table ----------------------------------------------------------------------------------------


def loop_table(section: Section, about: Mapping[str, Any]) -> Table | None:
    """Widths and lags of all loops; None where no model has any."""
    entries = [*remembering(section), *filter(remembers, section.of_role("truth"))]
    if not entries:
        return None
    unit = about["torque_unit"]
    columns = [Column("model", words=True), Column("joint", words=True), Column("Hz")]
    columns += [Column(f"{words} width [m{unit}]") for words in KINDS.values()]
    columns.append(Column(f"{KINDS['offset']} lag [ms]"))
    lines = []
    for entry in entries:
        for joint, name in enumerate(about["joints"]):
            pairs = [loops_of(entry, joint, kind) for kind in KINDS]
            for loops in zip(*pairs, strict=True):
                cells = [Cell(entry.title), Cell(str(name)), Cell(f"{loops[0].frequency:.3g}")]
                cells += [Cell(_scattered(1e3 * loop.width[loop.folds])) for loop in loops]
                cells.append(Cell(_scattered(1e3 * loops[-1].lag[loops[-1].folds])))
                lines.append(Line(tuple(cells), entry.title))
    caption = (
        f"{section.dataset}: loops of friction over velocity, mean ± standard deviation over the "
        "folds. Width: torque at rising less that at falling speed, mean over the speeds. Lag: how "
        "much later velocity must be taken for the loop to close best."
    )
    return Table(caption, f"loops-{section.dataset}", tuple(columns), tuple(lines))


def _scattered(values: Array) -> str:
    known = values[np.isfinite(values)]
    if not len(known):
        return NOTHING
    if len(known) == 1 or np.ptp(known) < 1e-9:
        return short(float(known[0])) if abs(known[0]) > 1e-9 else "0"
    deviation = float(known.std(ddof=1))
    places = decimals([deviation])
    return f"{fixed(float(known.mean()), places)} ± {fixed(deviation, places)}"


# --- Words ----------------------------------------------------------------------------------------


def loop_findings(section: Section, about: Mapping[str, Any]) -> list[str]:
    """What speeds that never reverse tell of memory: who is late, by how much, and the truth."""
    entries = remembering(section)
    if not entries:
        return []
    head = f"Memory, on speeds that never reverse ({listed(_frequencies(entries[0], about))})"
    out = []
    for recipe in dict.fromkeys(entry.recipe for entry in entries):
        own = [entry for entry in entries if entry.recipe == recipe]
        told = [f"{named(section, entry)}: {_late(entry, about)}" for entry in own]
        words = f"{head}: {'; '.join(told)}."
        late = any(_is_late(entry, j) for entry in own for j in range(len(about["joints"])))
        if late and not any("delay" in entry.way.get("corrects", ()) for entry in own):
            words += " A torque clock that is off by as much would look the same."
        out.append(words)
    truth = [entry for entry in section.of_role("truth") if entry.loops]
    if truth and remembers(truth[0]):
        out[-1] += f" The true friction: {_late(truth[0], about)}."
    elif truth:
        out[-1] += " The true friction remembers nothing."
    return out


def _frequencies(entry: Entry, about: Mapping[str, Any]) -> list[str]:
    each = [middle(loops_of(entry, j, "offset")).frequency for j in range(len(about["joints"]))]
    return [f"{f:.3g} Hz" for f in dict.fromkeys(each)]


def _is_open(loop: Shown) -> bool:
    """Whether a loop is wider than a part of its torque, and than the scatter of the folds."""
    width = loop.width[loop.folds]
    scatter = float(width.std(ddof=1)) if len(width) > 1 else 0.0
    return bool(_share(loop) >= NARROW and abs(width.mean()) > SURE * scatter)


def _is_late(entry: Entry, joint: int) -> bool:
    """Whether a joint's loop is open, and closed by a lag beyond the scatter of the folds."""
    loop = middle(loops_of(entry, joint, "offset"))
    lag = loop.lag[loop.folds]
    if not (_is_open(loop) and np.isfinite(lag).all()):
        return False
    scatter = float(lag.std(ddof=1)) if len(lag) > 1 else 0.0
    return bool(SURE * scatter < abs(lag.mean()) < LATEST / loop.frequency)


def _share(loop: Shown) -> float:
    """Width of a loop in units of the torque's size."""
    own = loop.torque[loop.folds]
    return float(abs(loop.width[loop.folds].mean()) / max(np.sqrt(np.mean(own**2)), 1e-300))


def _late(entry: Entry, about: Mapping[str, Any]) -> str:
    parts = []
    for joint, name in enumerate(about["joints"]):
        loop = middle(loops_of(entry, joint, "offset"))
        width = f"{_scattered(1e3 * loop.width[loop.folds])} m{about['torque_unit']}"
        lag = 1e3 * loop.lag[loop.folds]
        if _is_late(entry, joint):
            when = "late" if lag.mean() > 0 else "early"
            parts.append(
                f"{name} follows the velocity {_scattered(np.abs(lag))} ms {when}, its loop "
                f"{width} wide ({percent(_share(loop))} of its torque)"
            )
        elif _is_open(loop):
            parts.append(
                f"{name} has a loop {width} wide ({percent(_share(loop))} of its torque) that no "
                "lag of the velocity closes"
            )
        elif _share(loop) < NARROW:
            parts.append(f"{name} has no loop (below {percent(NARROW)} of its torque)")
        else:
            parts.append(f"{name} has a loop {width} wide, inside the scatter of the folds")
    return listed(parts)
