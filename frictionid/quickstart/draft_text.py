"""Texts of a first dataset.toml and suite.toml, with comments that say what speaks for them."""

import json
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.data.readers.table import Table
from frictionid.data.recordings import Dataset
from frictionid.evaluation.folds import usual_kind
from frictionid.files import BAGS
from frictionid.mechanics import Mechanism
from frictionid.report.tables import render

from .column_guesses import ColumnGuesses
from .quick import plan_for

_COMMENT = 40  # column of the comments
_LONG, _WIDE = 96, 130  # of a line, and of one with its comment


class Tables(NamedTuple):
    """Tables of recordings with the same columns, in one folder; the first one is read."""

    folder: Path
    files: tuple[str, ...]
    first: Table


class Draft(NamedTuple):
    """All that a first dataset.toml says.

    tables : of the recordings; mechanism : the [mechanism] table
    motor : [motor], where columns are of motors, or hold currents; actuator : [actuator]
    machine : the mechanism; comments : comments of keys of [mechanism], and below it as ""
    velocity : columns of velocities; base : [base], where an IMU says how it moves
    missing : what was not given and no guess replaces, and what happens without it
    evidence : what speaks for signs and units, from the physics
    """

    tables: Tables
    mechanism: Mapping[str, Any]
    guesses: ColumnGuesses
    machine: Mechanism
    motor: Mapping[str, Any]
    comments: Mapping[str, str]
    actuator: Mapping[str, Any]
    velocity: tuple[str, ...] = ()
    base: Mapping[str, Any] = {}
    missing: tuple[str, ...] = ()
    evidence: tuple[str, ...] = ()


def dataset_text(draft: Draft) -> str:
    """Text of the dataset.toml of a draft."""
    g = draft.guesses
    units = [g.angle.unit] if isinstance(g.angle.unit, str) else g.angle.unit
    context = {
        "g": g,
        "values": draft.mechanism.get("parameters", {}),
        "driven": any(g.torque.columns),
        "bags": draft.tables.files[0].endswith(BAGS),
        "rates": [f"{unit}/s" for unit in units],
        "turned": {key: signs for key, signs in g.signs.items() if set(signs) != {1}},
    }
    return _rendered("dataset.toml.j2", draft, context)


def suite_text(draft: Draft, dataset: Dataset) -> str:
    """Text of a first suite: the laws and the method of `frictionid quick`."""
    plan, folds = plan_for(dataset), usual_kind(dataset.recordings)
    laws = [law.model_dump(exclude_none=True) for law in plan.laws]
    context = {"folds": folds, "by_torque": plan.by_torque, "laws": laws}
    return _rendered("suite.toml.j2", draft, context)


def _rendered(template: str, draft: Draft, context: Mapping[str, Any]) -> str:
    filters = {"alone": _one_or_all, "comment": _comment}
    names = {"draft": draft, "line": _line, "name": draft.tables.folder.resolve().name}
    return render(template, {**names, **context}, filters=filters)


def _one_or_all(values: Sequence[Any]) -> Any:
    return values[0] if len(values) == 1 else list(values)


def _comment(text: str) -> str:
    return textwrap.fill(text, _LONG, initial_indent="# ", subsequent_indent="# ")


def _line(key: str, value: Any, comment: str = "") -> str:
    """A key with its value, and a comment: behind it, or above where the line would be long.

    >>> print(_line("locked", {"arm_5": 0.1}, "no motor"))
    locked = { arm_5 = 0.1 }                # no motor
    """
    text = json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        pairs = ((json.dumps(k) if "." in k else k, json.dumps(v)) for k, v in value.items())
        text = ", ".join(f"{key} = {entry}" for key, entry in pairs)
        text = f"{{ {text} }}"
    line = f"{key} = {text}"
    if len(line) > _LONG and isinstance(value, list | tuple):
        entries = textwrap.wrap(text[1:-1], _LONG, initial_indent="    ", subsequent_indent="    ")
        line = "\n".join([f"{key} = [", *entries, "]"])
    if not comment:
        return line
    if len(max(line.splitlines(), key=len)) + len(comment) > _WIDE or "\n" in line:
        return f"{_comment(comment)}\n{line}"
    return f"{line:<{_COMMENT - 1}} # {comment}"
