"""Whether learned friction predicts as well as textbook friction, and physics better than none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frictionid.report.hybrid_text import family
from frictionid.report.load import Entry, Key
from frictionid.report.numbers import listed, short
from frictionid.report.paired import best, level, paired
from frictionid.report.text import Matter, named

NEAR = 0.1  # of the error of the best textbook friction


def learned_findings(m: Matter) -> list[str]:
    """Sentences on one data set; none where there is nothing to set against each other."""
    if not m.horizons:
        return []
    key = Key("rollout_angle", "median", m.horizons[0])  # 0.5 s, where a suite has it
    fitted = _each(m, key)
    own = {
        name: [e for e in fitted if family(e) == name]
        for name in ("physics", "hybrid", "black box")
    }
    told = (
        _within(m, own["physics"], own["hybrid"], key),
        _beaten(m, [*own["physics"], *own["hybrid"]], own["black box"], key),
    )
    return [sentence for sentence in told if sentence]


def _each(m: Matter, key: Key) -> list[Entry]:
    """Each identifier as it predicts best: under the recipe that suits it."""
    by_label: dict[str, list[Entry]] = {}
    for entry in m.entries("fitted"):
        by_label.setdefault(entry.label, []).append(entry)
    return [best(own, m.dataset, key) or own[0] for own in by_label.values()]


def _within(m: Matter, textbook: Sequence[Entry], learned: Sequence[Entry], key: Key) -> str:
    """Whether each learned model is within ten per cent of the best one from the textbook."""
    first = best(textbook, m.dataset, key)
    if first is None or not learned:
        return ""
    size = level(first, m.dataset, key)
    far = [e for e in learned if not level(e, m.dataset, key) <= (1 + NEAR) * size]
    whom = f"{100 * NEAR:.0f} %"
    rival = (
        f"{named(m.section, first)} ({short(size)} {m.unit}), the best with friction from the "
        "textbook"
    )
    after = f"after {key.horizon:g} s"
    if not far:
        every = "every model with learned friction"
        if len(learned) == 1:
            every = f"{named(m.section, learned[0])}, the model with learned friction,"
        return f"{_place(m, after)} {every} is within {whom} of {rival}."
    names = listed([f"{named(m.section, e)} ({_more(m, e, first, key)})" for e in far])
    if len(learned) == 1:
        return (
            f"{_place(m, after)} the model with learned friction, {names}, is not within {whom} of "
            f"{rival}."
        )
    verb = "is" if len(far) == 1 else "are"
    return (
        f"{_place(m, after)} {len(learned) - len(far)} of {len(learned)} models with learned "
        f"friction are within {whom} of {rival}: {names} {verb} not."
    )


def _beaten(m: Matter, physics: Sequence[Entry], boxes: Sequence[Entry], key: Key) -> str:
    """Whether every model with physics and friction beats every black box."""
    if not physics or not boxes:
        return ""
    first, after = best(boxes, m.dataset, key), f"after {key.horizon:g} s"
    if first is None:
        return f"{_place(m, after)} no black box predicts with a finite median error."
    size = level(first, m.dataset, key)
    lost = [e for e in physics if not level(e, m.dataset, key) < size]
    box = f"{named(m.section, first)} ({short(size)} {m.unit})"
    if not lost:
        return (
            f"{_place(m, after)} physics with friction beats every black box: each such model is "
            f"less off than {box}, the best one without physics."
        )
    beat = len(physics) - len(lost)
    names = listed([f"{named(m.section, e)} ({_more(m, e, first, key)})" for e in lost])
    verb = "does" if len(lost) == 1 else "do"
    return (
        f"{_place(m, after)} physics with friction does not always beat the best black box, {box}: "
        f"{beat} of {len(physics)} such models {'does' if beat == 1 else 'do'}, {names} {verb} not."
    )


def _place(m: Matter, after: str) -> str:
    if m.dataset == m.section.dataset:
        return f"On held-out motion {after}"
    return f"There, {after},"


def _more(m: Matter, entry: Entry, rival: Entry, key: Key) -> str:
    """By how much an entry is further off than a rival; what the folds cannot tell is said."""
    size = level(entry, m.dataset, key)
    if not np.isfinite(size):
        return "not finite"
    more = f"+{100 * (size / level(rival, m.dataset, key) - 1):.0f} %"
    unsure = m.dataset == m.section.dataset and not paired(entry, rival, m.dataset, key).clear
    return f"{more}, not told apart by the folds" if unsure else more
