"""Texts of a first dataset.toml and a first suite, with comments that say why."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from frictionid.mechanics import mechanism_of
from frictionid.quickstart.column_guesses import ColumnGuesses

_COMMENT = 40  # column of the comments


@dataclass(frozen=True)
class Draft:
    """All that a first dataset.toml says.

    files : tables of the recordings; mechanism : the [mechanism] table
    motor : [motor], where the columns of torque hold currents
    evidence : what speaks for signs and units, from the physics
    """

    name: str
    files: tuple[str, ...]
    mechanism: Mapping[str, Any]
    guesses: ColumnGuesses
    motor: Mapping[str, float] = field(default_factory=dict)
    evidence: tuple[str, ...] = ()


def dataset_text(draft: Draft) -> str:
    """Text of the dataset.toml of a draft."""
    parts = (_head, _mechanism, _columns, _units, _motor, _signs, _hold, _recordings)
    return "\n".join(line for part in parts for line in part(draft)) + "\n"


def suite_text(draft: Draft, horizons: Sequence[float]) -> str:
    """Text of a first suite: no friction, Coulomb and viscous, Stribeck, by two recipes."""
    return "\n".join(_suite(draft, horizons)) + "\n"


def _head(draft: Draft) -> Iterator[str]:
    yield "# Written by frictionid init: what speaks for its guesses stands behind each #."
    yield "# Correct what is wrong. All keys: data/README.md of frictionid."
    yield _line("name", draft.name)
    for text in draft.evidence:
        yield from textwrap.wrap(text, 96, initial_indent="# ", subsequent_indent="# ")


def _mechanism(draft: Draft) -> Iterator[str]:
    kind, given = draft.mechanism["kind"], draft.mechanism.get("parameters", {})
    yield "\n[mechanism]"
    yield _line("kind", kind, f"all of it: frictionid mechanisms {kind}")
    for key, value in draft.mechanism.items():
        if key not in ("kind", "parameters"):
            yield _line(key, value)
    yield "\n[mechanism.parameters]"
    for p in mechanism_of(draft.mechanism).parameters:
        name, said = p.name, f"{p.meaning} [{p.unit}]"
        usual = "" if name in given else "# "
        yield usual + _line(
            name, given.get(name, p.default), said + ("; usual value" * bool(usual))
        )


def _columns(draft: Draft) -> Iterator[str]:
    g = draft.guesses
    yield "\n[columns]"
    yield _line("time", g.time.columns[0], g.time.evidence)
    yield _line("angle", _one_or_all(g.angle.columns), g.angle.evidence)
    yield _line("torque", _one_or_all(g.torque.columns), g.torque.evidence)
    if g.missing:
        yield _line("missing", "drop", f"{g.missing} rows have no angle: they are gaps")
    if g.unused:
        yield f"# not used: {', '.join(g.unused)}"


def _units(draft: Draft) -> Iterator[str]:
    g = draft.guesses
    yield "\n[units]"
    yield _line("time", g.time.unit)
    yield _line("angle", g.angle.unit)
    yield _line("torque", g.torque.unit, "a current, see [motor]" if draft.motor else "")


def _motor(draft: Draft) -> Iterator[str]:
    if draft.motor:
        yield "\n[motor]"
        yield _line("kt", draft.motor["kt"], "torque constant at the motor's shaft [N m/A]")
        yield _line("gear", draft.motor["gear"], "torque at the joint = kt gear current")


def _signs(draft: Draft) -> Iterator[str]:
    turned = {key: signs for key, signs in draft.guesses.signs.items() if set(signs) != {1}}
    if turned:
        yield "\n[signs]"
        for key, signs in turned.items():
            yield _line(key, _one_or_all(signs), "-1: the column counts the other way round")


def _hold(draft: Draft) -> Iterator[str]:
    said = {
        "previous": "held until the next value; a sensor's samples: linear",
        "linear": "a sensor's samples, which change all the time",
    }
    yield "\n[hold]"
    yield _line("torque", draft.guesses.hold, said[draft.guesses.hold])


def _recordings(draft: Draft) -> Iterator[str]:
    yield "\n[recordings]"
    yield _line("patterns", list(draft.files))


def _suite(draft: Draft, horizons: Sequence[float]) -> Iterator[str]:
    single = len(draft.files) == 1
    yield "# A first suite: frictionid compare suite.toml"
    yield _line("name", f"{draft.name}-first")
    yield _line("horizons", list(horizons), "predictions so far ahead are scored [s]")
    yield "\n[folds]"
    yield _line(
        "kind",
        "blocks" if single else "recordings",
        "stretches of time: there is one recording" if single else "whole recordings are held out",
    )
    yield "\n[[datasets]]"
    yield _line("path", ".")
    yield "\n[[recipes]]"
    yield _line("name", "integral", "momentum balance of smoothed states: seconds")
    yield "\n[[recipes]]"
    yield _line("name", "shooting", "on the measured angles, with intervals: a minute or more")
    yield _line("by", "shooting")
    yield "# free are friction, and the delay where a motor's torque is sampled, or what is named:"
    yield '# free = ["friction", "delay", "inertia"]     # also: "gain", "bias", "offset"'
    for kind, said in (
        ("none", "the baseline"),
        ("coulomb_viscous", "all kinds: frictionid identifiers"),
        ("stribeck", ""),
    ):
        yield "\n[[identifiers]]"
        yield _line("kind", kind, said)


def _one_or_all(values: Sequence[Any]) -> Any:
    return values[0] if len(values) == 1 else list(values)


def _line(key: str, value: Any, comment: str = "") -> str:
    line = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    return f"{line:<{_COMMENT}}# {comment}" if comment else line
