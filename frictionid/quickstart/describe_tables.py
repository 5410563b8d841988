"""From tables to a dataset.toml: columns guessed by names and numbers, signs by the physics."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
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
from frictionid.quickstart.column_guesses import ColumnGuesses, Joints, guess_columns
from frictionid.quickstart.dataset_text import Draft, dataset_text, suite_text

_HORIZONS = (0.1, 0.25, 0.5, 1.0)  # [s]
_BEFORE = 0.5  # [s] of a recording that predictions need beside their horizon


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
        missing = [name for name in first.columns if name not in other.columns]
        if missing:
            raise InputError(
                f"{other.file} has no column of numbers {missing[0]!r}, which {first.file} has; "
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


def guess_tables(tables: Tables, mechanism: Mapping[str, Any], known: Known) -> ColumnGuesses:
    """Guesses of the columns under a [mechanism] table.

    Raises
    ------
    InputError
        Where no column fits a quantity.
    """
    description = mechanism_of(mechanism)
    joints = Joints(description.driven, description.position_units)
    return guess_columns(tables.first, joints, known.columns)


def describe_tables(tables: Tables, mechanism: Mapping[str, Any], known: Known) -> Described:
    """A dataset.toml and a first suite for tables of a mechanism.

    Columns and units are guessed by names and numbers; units and signs are then corrected where the
    motion contradicts them, see `frictionid.check`.

    Raises
    ------
    InputError
        Where no column fits a quantity, a constant is missing, or the tables are damaged.
    """
    guesses = guess_tables(tables, mechanism, known)
    if guesses.is_current and known.kt is None:
        names = ", ".join(filter(None, guesses.torque.columns))
        raise InputError(
            f"{names} holds currents [{guesses.torque.unit}]: give the motor's torque constant "
            "with --kt [N m/A] and its gear ratio with --gear, or name a torque with --torque"
        )
    motor = {"kt": known.kt, "gear": known.gear} if guesses.is_current and known.kt else {}
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
