"""From tables to a dataset.toml and a first suite, with comments that say what speaks for them.

Columns are guessed by names and numbers, signs by the physics.
"""

from __future__ import annotations

import json
import tempfile
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from frictionid.check import check
from frictionid.check.conventions import Convention
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.readers.dataset_path import TABLES, is_table
from frictionid.data.readers.table import Table, numeric_table
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.files import read_bytes
from frictionid.mechanics import mechanism_of
from frictionid.quickstart.column_guesses import ColumnGuesses, guess_columns

_HORIZONS = (0.1, 0.25, 0.5, 1.0)  # [s]
_BEFORE = 0.5  # [s] of a recording that predictions need beside their horizon
_COMMENT = 40  # column of the comments


@dataclass(frozen=True)
class Tables:
    """Tables of recordings with the same columns, in one folder; the first one is read."""

    folder: Path
    files: tuple[str, ...]
    first: Table


@dataclass(frozen=True)
class Known:
    """What is known of the tables: columns by quantity, and kt [N m/A] and gear of the motors."""

    columns: Mapping[str, Sequence[str]] = field(default_factory=dict)
    kt: float | None = None
    gear: float = 1.0


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


@dataclass(frozen=True)
class Described:
    """Texts of dataset.toml and suite.toml, the data set that they describe, and the guesses."""

    dataset_toml: str
    suite_toml: str
    dataset: Dataset
    draft: Draft


def tables_at(paths: Sequence[Path]) -> Tables:
    """The tables at some paths: files of one folder, or a folder.

    Raises
    ------
    InputError
        Where there are none, they lie in several folders, or have other columns than the first.
    """
    files = [f for path in paths for f in (_tables_in(path) if path.is_dir() else [path])]
    for file in files:
        if not is_table(file):
            end = ", ".join(TABLES)
            raise InputError(f"{file}: no table that ends with {end}; name one, or its folder")
    folders = {file.parent for file in files}
    if len(folders) > 1:
        raise InputError(
            f"the tables lie in {len(folders)} folders; a data set is one folder: move them there"
        )
    first, *others = (numeric_table(read_bytes(file), str(file)) for file in files)
    for other in others:
        for name in first.columns:
            if name not in other.columns:
                raise InputError(
                    f"{other.file} has no column of numbers {name!r}, which {first.file} has; "
                    "name the tables that belong together"
                )
    return Tables(files[0].parent, tuple(sorted(file.name for file in files)), first)


def _tables_in(folder: Path) -> list[Path]:
    files = sorted(file for file in folder.iterdir() if is_table(file))
    if not files and (folder / "meta" / "info.json").is_file():
        raise InputError(
            f"{folder} is a LeRobot data set, whose features no guess can assign: write a "
            'dataset.toml with [reader] kind = "lerobot", as in data/README.md of frictionid'
        )
    if not files:
        raise InputError(f"{folder} has no table that ends with {', '.join(TABLES)}")
    return files


def guess_tables(tables: Tables, mechanism: Mapping[str, Any], facts: Known) -> ColumnGuesses:
    """Guesses of the columns under a [mechanism] table.

    Raises
    ------
    InputError
        Where no column fits a quantity.
    """
    machine = mechanism_of(mechanism)
    return guess_columns(tables.first, machine.driven, machine.position_units, facts.columns)


def describe_tables(tables: Tables, mechanism: Mapping[str, Any], facts: Known) -> Described:
    """A dataset.toml and a first suite for tables of a mechanism.

    Columns and units are guessed by names and numbers; units and signs are then corrected where the
    motion contradicts them, see `frictionid.check`.

    Raises
    ------
    InputError
        Where no column fits a quantity, a constant is missing, or the tables are damaged.
    """
    guesses = guess_tables(tables, mechanism, facts)
    if guesses.is_current and facts.kt is None:
        names = ", ".join(filter(None, guesses.torque.columns))
        raise InputError(
            f"{names} holds currents [{guesses.torque.unit}]: give the motor's torque constant "
            "with --kt [N m/A] and its gear ratio with --gear, or name a torque with --torque"
        )
    motor = {"kt": facts.kt, "gear": facts.gear} if guesses.is_current and facts.kt else {}
    draft = Draft(tables.folder.resolve().name, tables.files, mechanism, guesses, motor)
    dataset = _loaded(draft, tables.folder)
    corrected = _corrected(draft, dataset)
    if corrected is not draft:
        draft, dataset = corrected, _loaded(corrected, tables.folder)
    longest = max(float(np.ptp(r.angle.time)) for r in dataset.recordings)
    horizons = [h for h in _HORIZONS if h + _BEFORE <= longest] or [_HORIZONS[0]]
    return Described(dataset_text(draft), suite_text(draft, horizons), dataset, draft)


def _loaded(draft: Draft, folder: Path) -> Dataset:
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "dataset.toml"
        file.write_text(dataset_text(draft), encoding="utf-8")
        try:
            return load_dataset(file, folder)
        except InputError as error:
            raise InputError(str(error).replace(f"{file}: ", "")) from None


def _corrected(draft: Draft, dataset: Dataset) -> Draft:
    """The draft with the convention that the motion asks for, where it contradicts the guesses."""
    verdict = check(dataset)
    kinds = {finding.kind: finding for finding in verdict.findings}
    fitting = [s for s in verdict.conventions if s.convention.kind in kinds]
    if not fitting:
        return draft
    best = min(fitting, key=lambda s: s.score).convention
    guesses = _with_convention(draft.guesses, best)
    text = kinds[best.kind].text
    if guesses is None:
        return replace(draft, evidence=(*draft.evidence, f"frictionid check: {text}"))
    return replace(draft, guesses=guesses, evidence=(*draft.evidence, f"corrected: {text}"))


def _with_convention(guesses: ColumnGuesses, best: Convention) -> ColumnGuesses | None:
    """The guesses under a convention; None where dataset.toml has no key for it."""
    units = {"degrees": "deg", "radians": "rad", "millimetres": "mm", "metres": "m"}
    if best.kind in units:
        return guesses.with_angle_unit(units[best.kind], "by the motion, see above")
    if best.kind not in ("flipped_angle", "flipped_torque", "flipped_joint"):
        return None
    diagonals = {"angle": best.angle, "torque": best.torque}
    signs = {key: tuple(int(s) for s in np.diag(d)) for key, d in diagonals.items()}
    return replace(guesses, signs=signs)


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
    kind, values = draft.mechanism["kind"], draft.mechanism.get("parameters", {})
    yield "\n[mechanism]"
    yield _line("kind", kind, f"all of it: frictionid mechanisms {kind}")
    for key, value in draft.mechanism.items():
        if key not in ("kind", "parameters"):
            yield _line(key, value)
    yield "\n[mechanism.parameters]"
    for p in mechanism_of(draft.mechanism).parameters:
        comment, value = f"{p.meaning} [{p.unit}]", values.get(p.name, p.default)
        usual = p.name not in values
        text = _line(p.name, value, comment + "; usual value" * usual)
        yield "# " * usual + text


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
    yield "# free are friction, and of inertia, delay, bias what the data tell, or what is named:"
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
