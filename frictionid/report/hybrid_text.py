"""The main question of the study: whether hybrids beat physics alone, and models without it.

Physics is a mechanism with friction from the textbook, or with none; a hybrid the same mechanism
with friction that was learned; a black box has no mechanism at all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from frictionid.report.load import Entry, Key, Section
from frictionid.report.numbers import decimals, fixed, listed, short
from frictionid.report.paired import best, level, paired
from frictionid.report.tables import Cell, Column, Line, Table, code
from frictionid.report.text import Matter, matter, named

FAMILIES = ("physics", "hybrid", "black box")
# laws whose form was not told but learned, by their names in model files
LEARNED = ("mlp", "window_mlp", "lstm", "ensemble", "TorchModule", "library", "table")
_SPLINES = ("spline", "spline_asymmetric")
WORDS = {
    "physics": "physics with textbook friction",
    "hybrid": "physics with learned friction",
    "black box": "no physics",
}


class Question(NamedTuple):
    """The answer: one sentence for each data set, and the table."""

    words: tuple[str, ...]
    table: Table


def family(entry: Entry) -> str:
    """Family of an entry; "" for fixed numbers and the truth."""
    if entry.role not in ("none", "fitted"):
        return ""
    if entry.model.get("mechanism"):
        return "black box"
    kind = entry.model.get("law", {}).get("kind", "")
    return "hybrid" if kind in (*LEARNED, *_SPLINES) else "physics"


def question(
    section: Section, horizons: Sequence[float], about: Mapping[str, Mapping[str, Any]]
) -> Question | None:
    """Sentences and table; None where a family is missing or nothing is predicted."""
    own = {name: [e for e in section.entries if family(e) == name] for name in FAMILIES}
    matters = [matter(section, d, horizons, about[d]) for d in (section.dataset, *section.tests)]
    if not all(own.values()) or not matters[0].horizons:
        return None
    words = [_sentence(m, own) for m in matters]
    return Question(tuple(w for w in words if w), _table(section, matters, own))


def _key(m: Matter) -> Key:
    """The median rollout error at the first horizon told: 0.5 s, where a suite has it."""
    return Key("rollout_angle", "median", m.horizons[0])


def _sentence(m: Matter, own: Mapping[str, Sequence[Entry]]) -> str:
    key = _key(m)
    first = {name: best(entries, m.dataset, key) for name, entries in own.items()}
    physics, hybrid, box = (first[name] for name in FAMILIES)
    if physics is None or hybrid is None or box is None:
        return ""
    sizes = {e: short(level(e, m.dataset, key)) for e in (physics, hybrid, box)}
    where = "On held-out motion" if m.dataset == m.section.dataset else f"On {code(m.dataset)}"
    over = [_against(m, hybrid, rival, key) for rival in (physics, box)]
    answer = f"{_answer([o > 0 for o in over])}{_unsure(m, over)}"
    return (
        f"{where} the best hybrid, {named(m.section, hybrid)}, is off by {sizes[hybrid]} {m.unit} "
        f"after {key.horizon:g} s, the best of physics with textbook friction, "
        f"{named(m.section, physics)}, by {sizes[physics]}, and the best black box, "
        f"{named(m.section, box)}, by {sizes[box]}: {answer}."
    )


def _against(m: Matter, hybrid: Entry, rival: Entry, key: Key) -> int:
    """2 where the hybrid is clearly better, 1 better, -1 worse, -2 clearly worse, by the folds."""
    better = level(hybrid, m.dataset, key) < level(rival, m.dataset, key)
    clear = paired(hybrid, rival, m.dataset, key).clear
    return (1 if better else -1) * (2 if clear else 1)


def _answer(beats: Sequence[bool]) -> str:
    return {
        (True, True): "the hybrid beats both",
        (True, False): "the hybrid beats physics alone, but not the black box",
        (False, True): "the hybrid beats the black box, but not physics alone",
        (False, False): "the hybrid beats neither",
    }[beats[0], beats[1]]


def _unsure(m: Matter, over: Sequence[int]) -> str:
    """What the folds cannot tell; on data that only test there are none."""
    if m.dataset != m.section.dataset:
        return ""
    rivals = zip(("physics alone", "the black box"), over, strict=True)
    close = [rival for rival, o in rivals if abs(o) == 1]
    return f", though the folds hardly tell it from {listed(close)}" if close else ""


def _table(
    section: Section, matters: Sequence[Matter], own: Mapping[str, Sequence[Entry]]
) -> Table:
    """Median rollout errors of all models, by family, at the horizons told of each data set."""
    places = [(m, h) for m in matters for h in m.horizons]
    entries = [(name, entry) for name in FAMILIES for entry in own[name]]
    values = np.array(
        [
            [level(e, m.dataset, Key("rollout_angle", "median", h)) for m, h in places]
            for _, e in entries
        ]
    )
    finite = np.where(np.isfinite(values), values, np.inf)
    digits = [decimals(column) for column in values.T]
    lines = [
        Line(
            (
                Cell(WORDS[name]),
                Cell(entry.title if len(section.recipes) > 1 else entry.label),
                *(
                    Cell(fixed(v, d), bool(v == low))
                    for v, d, low in zip(row, digits, finite.min(axis=0), strict=True)
                ),
            ),
            name,
        )
        for (name, entry), row in zip(entries, values, strict=True)
    ]
    columns = [Column(f"{m.dataset}, {h:g} s", unit=m.unit) for m, h in places]
    return Table(
        f"Median {matters[0].what} error of predictions by what a model knows: on held-out motion "
        f"of {section.dataset}, and on data that no fit has seen.",
        f"tab:question-{section.dataset}",
        (Column("what it knows", words=True), Column("model", words=True), *columns),
        tuple(lines),
    )
