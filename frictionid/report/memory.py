"""Analysis of memory: why a model with memory beats one without, one step ahead.

The advantage of the best model with memory over the best without is read under recipes whose data
are calibrated by shooting: the clock of the torque, the inertia. What a correction takes away was
never memory; what the corrected recipes leave may be.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.evaluation.hysteresis import HysteresisLoop
from frictionid.evaluation.statistics import CorrelatedTest

from .figures.style import (
    DARK,
    DASHED,
    GREY,
    ZERO,
    Styles,
    mixed,
    model_title,
    panels,
    plain,
    side_by_side,
    truth_key,
)
from .figures.style import line as drawn_line
from .numbers import either, mean_sd, percent
from .sections import EULER, Model, Section, SummaryData, rollout
from .tables import Table, line, table_of, text_columns

KINDS = {"reversing": "reversing", "offset": "never reversing"}
ROUNDING = 1e-9


def loops_of(model: Model, joint: int, kind: str) -> list[HysteresisLoop]:
    """Loops of a model's joint on one kind of motion, from slow to fast."""
    loops = [loop for loop in model.loops if (loop.joint, loop.kind) == (joint, kind)]
    return sorted(loops, key=lambda loop: loop.frequency)


def middle(loops: Sequence[HysteresisLoop]) -> HysteresisLoop:
    """The loop at the middle one of the frequencies."""
    return loops[len(loops) // 2]


def has_memory(model: Model) -> bool:
    """Whether any of a model's loops is open at all: friction of the velocity alone has none."""
    return any(
        (np.abs(loop.width) > ROUNDING * np.abs(loop.torque).max()).any() for loop in model.loops
    )


def with_loops(section: Section) -> list[Model]:
    """Fitted and given models of a section that have loops to show."""
    return [model for model in section.of_role("fitted", "given") if model.loops]


def with_memory(section: Section) -> list[Model]:
    """Fitted and given models of a section whose loops are open."""
    return list(filter(has_memory, with_loops(section)))


def loop_table(section: Section) -> Table | None:
    """Widths and lags of all loops, and what they say; None where no model has memory."""
    models = with_memory(section)
    if not models:
        return None
    models += [model for model in section.of_role("truth") if has_memory(model)]
    data = section.description
    unit = either([f"m{unit}" for unit in data.torque_units])
    heads = [*text_columns("model", "joint"), "Hz"]
    heads += [f"{text} width [{unit}]" for text in KINDS.values()]
    heads += [f"{KINDS['offset']} lag [ms]", "share of torque", *text_columns("verdict")]
    lines = []
    for model, (joint, name) in product(models, enumerate(data.joints)):
        for loops in zip(*(loops_of(model, joint, kind) for kind in KINDS), strict=True):
            offset = loops[-1]
            widths = [mean_sd(1e3 * loop.width[loop.folds]) for loop in loops]
            cells = [model.name, name, f"{offset.frequency:.3g}", *widths]
            cells += [mean_sd(1e3 * offset.lag[offset.folds]), percent(offset.share)]
            lines.append(line([*cells, offset.verdict], model.name))
    caption = (
        f"{section.dataset}: loops of friction over velocity, mean ± standard deviation over the "
        "folds. Width: torque at rising less that at falling speed, mean over the speeds. Lag: how "
        "much later velocity must be taken for the loop to close best. Share and verdict: of "
        "motion that never reverses. Closed: below 1 % of the torque. Scatter: inside that of the "
        "folds. Late, early: a lag closes the loop, as a torque clock that is off would. Open: no "
        "lag closes it."
    )
    return table_of(heads, lines, caption, f"loops-{section.dataset}")


# --- Pictures of loops ----------------------------------------------------------------------------

COLUMNS = 4  # models side by side; more go to another picture
REST = 1e-6  # of the largest velocity: there sgn(w) is rounding
RESOLVED = 0.01  # of the largest velocity: closer samples on both sides of a reversal are joined
TONES = (0.55, 0.0, -0.45)  # towards white, and towards black: from slow to fast


def loop_pictures(section: Section, styles: Styles) -> dict[str, list[Any]]:
    """Pictures of the loops by recipe: a column for each model, rows of joints and motions."""
    models = with_loops(section)
    by_recipe = {m.recipe: [o for o in models if o.recipe == m.recipe] for m in models}
    return {
        recipe: [_picture(section, part, styles) for part in side_by_side(columns, COLUMNS)]
        for recipe, columns in by_recipe.items()
    }


def _picture(section: Section, columns: Sequence[Model], styles: Styles) -> Any:
    data = section.description
    rows = list(product(range(len(data.joints)), KINDS))

    def draw(axis: Any, row: int, column: int) -> None:
        model, (joint, kind) = columns[column], rows[row]
        _panel(axis, loops_of(model, joint, kind), styles[model.label].colour)
        _truth(axis, section, joint, kind)
        if row == 0:
            model_title(axis, model, styles)

    labels = []
    for joint, kind in rows:
        loops = [loop for model in columns for loop in loops_of(model, joint, kind)]
        tones = ", ".join(dict.fromkeys(f"{loop.frequency:.3g}" for loop in loops))
        name = f"{plain(data.joints[joint])}, {KINDS[kind]}"
        labels.append(f"{name}\n{tones} Hz  [{data.torque_units[joint]}]")
    slow, between, fast = (drawn_line(mixed(GREY, tone), linewidth=1.5) for tone in TONES)
    key = {"slow": slow, "middle frequency": between, "fast": fast}
    key["each fold, middle frequency"] = drawn_line(GREY, linewidth=0.5, alpha=0.6)
    key |= truth_key(next(iter(section.of_role("truth")), data.truth))
    below = f"velocity [{data.velocity_unit}]"
    titles = [""] * len(columns)
    return panels(draw, labels, titles, key, below, 1.7, sharey="row", sharex="row")


def _panel(axis: Any, loops: Sequence[HysteresisLoop], colour: str) -> None:
    axis.locator_params(nbins=5)
    if not loops:
        return
    shown = middle(loops)
    if shown.kind == "reversing":
        axis.axhline(0, **ZERO)
    for torque in shown.torque[shown.folds]:
        axis.plot(*_closed(shown.velocity, torque), color=colour, linewidth=0.4, alpha=0.35)
    tones = np.interp(np.linspace(0, 2, len(loops)), (0, 1, 2), TONES) if len(loops) > 1 else [0.0]
    for loop, tone in zip(loops, tones, strict=True):
        mean = loop.torque[loop.folds].mean(axis=0)
        axis.plot(*_closed(loop.velocity, mean), color=mixed(colour, tone), linewidth=1.3)


def _truth(axis: Any, section: Section, joint: int, kind: str) -> None:
    """The true friction: its loop where it has one, else its curve."""
    style = {"color": DARK, "linewidth": 0.9, "linestyle": DASHED, "zorder": 4}
    data = section.description
    for model in section.of_role("truth"):
        loops = loops_of(model, joint, kind)
        if loops:
            w, torque = middle(loops).velocity, middle(loops).torque[-1]
            order = np.argsort(w)  # there and back on one line, dashes would fill each other
            ends = _closed(w, torque) if has_memory(model) else _broken(w[order], torque[order])
            axis.plot(*ends, **style)
            return
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


# --- What the advantage of memory consists of -----------------------------------------------------

BOTH = frozenset(("delay", "inertia"))


Method = tuple[str, frozenset[str]]  # scheme of a recipe, and what of a calibration corrects it
RAW: Method = ("euler", frozenset())


def memory_analysis(data: SummaryData) -> dict[str, Any] | None:
    """What the advantage of memory consists of, for the template.

    None where models with and without memory are missing under an Euler recipe.

    losses : models and their mean losses: no friction, without memory, with memory
    in_order, folds : in how many folds the losses fall in this order, of how many
    raw : advantage where nothing is corrected
    shares : what each correction takes off it, see `_shares`
    scheme, corrects : of the method that leaves the fewest other reasons
    static, dynamic, remaining : the best models without and with memory there, and its advantage
    rollouts : horizons [s], and the error that memory saves in predictions there
    """
    advantages = _advantages(data)
    if RAW not in advantages:
        return None
    *raw_models, raw = advantages[RAW]
    method = max(advantages, key=lambda m: (len(m[1] & BOTH), m[0] == "integral"))
    static, dynamic, remaining = advantages[method]
    models = [*data.of_role("none")[:1], *raw_models]
    each = [data.of_folds(model, EULER) for model in models]
    same = len({len(losses) for losses in each}) == 1 and len(each[0]) > 0
    pairs = [(h, data.paired(static, dynamic, rollout(h))) for h in data.reported]
    return {
        "losses": list(zip(models, np.mean(each, axis=1), strict=True)) if same else [],
        "in_order": int((np.diff(each, axis=0) < 0).all(axis=0).sum()) if same else 0,
        "folds": len(each[0]),
        "raw": raw,
        "shares": _shares({m: pair.mean for m, (_, _, pair) in advantages.items()}),
        "scheme": method[0],
        "corrects": method[1],
        "static": static,
        "dynamic": dynamic,
        "remaining": remaining,
        "rollouts": [p for p in pairs if p[1].clear is not None] if method[1] else [],
    }


def _advantages(data: SummaryData) -> dict[Method, tuple[Model, Model, CorrelatedTest]]:
    """The best models without and with memory under each method, and the error that it saves."""
    by_method: dict[Method, list[Model]] = {}
    for model in data.of_role("fitted"):
        if model.method.get("scheme") in ("euler", "integral"):
            key = str(model.method["scheme"]), frozenset(model.method.get("corrects", ()))
            by_method.setdefault(key, []).append(model)
    out = {}
    for key, models in by_method.items():
        static = data.best([m for m in models if not has_memory(m)], EULER)
        dynamic = data.best([m for m in models if has_memory(m)], EULER)
        if static is not None and dynamic is not None:
            out[key] = static, dynamic, data.paired(static, dynamic, EULER)
    return out


def _shares(ahead: Mapping[Method, float]) -> dict[str, float]:
    """What the corrections take off the advantage of memory [rad/s], by their names.

    With a, d, i, b the advantage uncorrected, with the delay, the inertia, and both corrected:
    delay (a - d + i - b) / 2, inertia (a - i + d - b) / 2, the mean over both orders; where only
    both are known together, a - b. "scheme" is what the integral scheme takes off b, as it has
    neither the noise of differences nor the Euler step.
    """
    raw = ahead[RAW]
    delay, inertia, both = (
        ahead.get(("euler", frozenset(part))) for part in (["delay"], ["inertia"], BOTH)
    )
    integral = ahead.get(("integral", BOTH))
    out: dict[str, float] = {}
    if delay is not None and inertia is not None and both is not None:
        out["delay"] = (raw - delay + inertia - both) / 2
        out["inertia"] = (raw - inertia + delay - both) / 2
    elif both is not None:
        out["delay and inertia"] = raw - both
    if integral is not None and both is not None:
        out["scheme"] = both - integral
    elif integral is not None:
        out["delay, inertia and scheme"] = raw - integral
    return out
