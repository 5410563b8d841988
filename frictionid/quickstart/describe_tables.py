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
from frictionid.mechanics import Mechanism, mechanism_of
from frictionid.quickstart.column_guesses import ColumnGuesses, guess_columns

Constants = float | Sequence[float]  # one, or one per joint
_HORIZONS = (0.1, 0.25, 0.5, 1.0)  # [s]
_BEFORE = 0.5  # [s] of a recording that predictions need beside their horizon
_COMMENT = 40  # column of the comments
_LONG, _WIDE = 96, 130  # of a line, and of one with its comment


@dataclass(frozen=True)
class Tables:
    """Tables of recordings with the same columns, in one folder; the first one is read."""

    folder: Path
    files: tuple[str, ...]
    first: Table


@dataclass(frozen=True)
class Known:
    """What is known of the tables: columns by quantity, and constants of the motors.

    kt : [N m/A]; gear : turns of the motor for one of the joint; one, or one per joint
    gains : P [N m/rad] and D [N m s/rad] of a controller that follows targets
    """

    columns: Mapping[str, Sequence[str]] = field(default_factory=dict)
    kt: Constants | None = None
    gear: Constants | None = None
    gains: tuple[float, float] | None = None


@dataclass(frozen=True)
class Draft:
    """All that a first dataset.toml says.

    files : tables of the recordings; mechanism : the [mechanism] table
    motor : [motor], where columns are of motors, or hold currents; actuator : [actuator]
    evidence : what speaks for signs and units, from the physics
    machine : the mechanism; comments : comments of keys of [mechanism], and below it as ""
    velocity : columns of velocities
    """

    name: str
    files: tuple[str, ...]
    mechanism: Mapping[str, Any]
    guesses: ColumnGuesses
    machine: Mechanism
    motor: Mapping[str, Any] = field(default_factory=dict)
    evidence: tuple[str, ...] = ()
    comments: Mapping[str, str] = field(default_factory=dict)
    actuator: Mapping[str, Any] = field(default_factory=dict)
    velocity: tuple[str, ...] = ()


@dataclass(frozen=True)
class Described:
    """Texts of dataset.toml and suite.toml, the data set that they describe, and the guesses.

    missing : what was not given and no guess replaces, and what happens without it
    """

    dataset_toml: str
    suite_toml: str
    dataset: Dataset
    draft: Draft
    missing: tuple[str, ...] = ()


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
    current = guesses.is_current and facts.kt is not None
    motor = {"kt": facts.kt, "gear": 1.0 if facts.gear is None else facts.gear} if current else {}
    name, machine = tables.folder.resolve().name, mechanism_of(mechanism)
    draft = Draft(name, tables.files, mechanism, guesses, machine, motor)
    return described_draft(draft, tables, _HORIZONS)


def described_draft(
    draft: Draft,
    tables: Tables,
    horizons: Sequence[float],
    missing: tuple[str, ...] = (),
    *,
    blind: bool = False,
) -> Described:
    """Texts of a draft, its signs and units corrected where the motion contradicts them.

    horizons : of the suite, of which those stay that the recordings hold
    missing : what is not known; blind : whether that is so much that nothing can be corrected
    """
    dataset = _loaded(draft, tables.folder)
    corrected = draft if blind else _corrected(draft, dataset)
    if corrected is not draft:
        draft, dataset = corrected, _loaded(corrected, tables.folder)
    longest = max(float(np.ptp(r.angle.time)) for r in dataset.recordings)
    fitting = [h for h in horizons if h + _BEFORE <= longest] or [horizons[0]]
    return Described(dataset_text(draft), suite_text(draft, fitting), dataset, draft, missing)


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
    guesses, motor = _with_convention(draft.guesses, best), _with_gears(draft, best)
    text = kinds[best.kind].text
    if guesses is None and motor is None:
        return replace(draft, evidence=(*draft.evidence, f"frictionid check: {text}"))
    evidence = (*draft.evidence, f"corrected: {text}")
    return replace(
        draft, guesses=guesses or draft.guesses, motor=motor or draft.motor, evidence=evidence
    )


def _with_gears(draft: Draft, best: Convention) -> dict[str, Any] | None:
    """The [motor] table with another zero or gear; None where that is not what is wrong."""
    motor, n = dict(draft.motor), len(best.angle)
    gear = np.broadcast_to(np.asarray(motor.get("gear", 1.0), dtype=float), n)
    flips = np.diag(best.angle)
    if best.kind == "flipped_gear" and np.array_equal(best.angle, np.diag(flips)):
        return {**motor, "gear": (gear * flips).tolist()}
    if best.kind != "shifted_angle" or not np.array_equal(best.angle, np.eye(n)):
        return None
    zero = np.broadcast_to(np.asarray(motor.get("offset", 0.0), dtype=float), n) + best.shift
    offset = [round(float(radians), 6) for radians in zero]
    return {"gear": gear.tolist(), **motor, "angle": "motor", "offset": offset}


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
    parts = (_head, _mechanism, _columns, _units, _motor, _actuator, _signs, _hold, _recordings)
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
    values = draft.mechanism.get("parameters", {})
    yield "\n[mechanism]"
    for key, value in draft.mechanism.items():
        said = f"all of it: frictionid mechanisms {value}" if key == "kind" else ""
        if key != "parameters":
            yield _line(key, value, draft.comments.get(key, said))
    for text in draft.comments.get("", "").splitlines():
        yield f"# {text}"
    yield "\n[mechanism.parameters]"
    for p in draft.machine.parameters:
        comment, value = f"{p.meaning} [{p.unit}]", values.get(p.name, p.default)
        usual = p.name not in values
        said = draft.comments.get(p.name, "; usual value" * usual)
        text = _line(p.name, value, comment + said)
        yield "# " * usual + text


def _columns(draft: Draft) -> Iterator[str]:
    g = draft.guesses
    yield "\n[columns]"
    yield _line("time", g.time.columns[0], g.time.evidence)
    yield _line("angle", _one_or_all(g.angle.columns), g.angle.evidence)
    if any(g.torque.columns):
        yield _line("torque", _one_or_all(g.torque.columns), g.torque.evidence)
    if draft.velocity:
        yield _line("velocity", _one_or_all(draft.velocity), "kept, and tested by check")
    if g.missing:
        yield _line("missing", "drop", f"{g.missing} rows have no angle: they are gaps")
    if g.unused:
        yield f"# not used: {', '.join(g.unused)}"


def _units(draft: Draft) -> Iterator[str]:
    g = draft.guesses
    yield "\n[units]"
    yield _line("time", g.time.unit)
    yield _line("angle", g.angle.unit)
    if any(g.torque.columns):
        yield _line("torque", g.torque.unit, "a current, see [motor]" if g.is_current else "")


_MOTOR = {
    "kt": "torque constant at the motor's shaft [N m/A]",
    "gear": "torque at the joint = kt gear current",
    "angle": "the columns are of the motors: joint angle = motor angle / gear + offset",
    "torque": "the columns are of the motors: torque at the joint = gear motor torque",
    "offset": "joint angles at which the motors' are zero [rad]",
}
_ACTUATOR = {
    "target": "targets that the joints follow: no torque was measured",
    "output": "P (target - angle) - D velocity is a torque at the joint",
    "P": "[N m/rad]",
    "D": "[N m s/rad]",
    "limit": "largest torques, of the file [N m]",
}


def _motor(draft: Draft) -> Iterator[str]:
    if draft.motor:
        yield "\n[motor]"
    for key, value in draft.motor.items():
        yield _line(key, value, draft.comments.get(f"motor.{key}", _MOTOR[key]))


def _actuator(draft: Draft) -> Iterator[str]:
    if draft.actuator:
        yield "\n[actuator]"
    for key, value in draft.actuator.items():
        yield _line(key, value, draft.comments.get(f"actuator.{key}", _ACTUATOR[key]))


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
    if any(draft.guesses.torque.columns):
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
    if draft.machine.kind in ("urdf", "mjcf"):
        yield from _robot_suite(draft)
        return
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


def _robot_suite(draft: Draft) -> Iterator[str]:
    """Recipe and laws for arms: torques where they are measured, else one step."""
    yield "\n[[recipes]]"
    if draft.actuator:
        yield _line("name", "integral", "no torque was measured: momentum balance, one step")
    else:
        yield _line("name", "inverse_dynamics", "friction, inertia, delay, bias by the torques")
    for kind, said in (
        ("none", "the baseline"),
        ("coulomb_viscous", "all kinds: frictionid identifiers"),
        ("stribeck", ""),
        *(
            (("load_dependent", "friction that grows with the load of the gear"),)
            * (not draft.actuator)
        ),
    ):
        yield "\n[[identifiers]]"
        yield _line("kind", kind, said)


def _one_or_all(values: Sequence[Any]) -> Any:
    return values[0] if len(values) == 1 else list(values)


def _line(key: str, value: Any, comment: str = "") -> str:
    """A key with its value, and a comment: behind it, or above where the line would be long.

    >>> print(_line("locked", {"arm_5": 0.1}, "no motor"))
    locked = { arm_5 = 0.1 }                # no motor
    """
    text = json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        text = ", ".join(f"{json.dumps(k) if '.' in k else k} = {v}" for k, v in value.items())
        text = f"{{ {text} }}"
    line = f"{key} = {text}"
    if len(line) > _LONG and isinstance(value, list):
        entries = textwrap.wrap(text[1:-1], _LONG, initial_indent="    ", subsequent_indent="    ")
        line = "\n".join([f"{key} = [", *entries, "]"])
    if not comment:
        return line
    if len(max(line.splitlines(), key=len)) + len(comment) > _WIDE or "\n" in line:
        above = textwrap.wrap(comment, _LONG, initial_indent="# ", subsequent_indent="# ")
        return "\n".join([*above, line])
    return f"{line:<{_COMMENT - 1}} # {comment}"
