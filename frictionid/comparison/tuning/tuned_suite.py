"""The suite with the settings that tuning chose."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from frictionid.comparison.search_space import Objective
from frictionid.comparison.tuning.studies import Found


def by_unit(found: Sequence[Found]) -> list[list[Found]]:
    """Studies grouped by what they tune."""
    return [list(own) for _, own in groupby(found, key=lambda f: f.unit.title)]


def best_of(found: Sequence[Found]) -> Found:
    """Of the studies of one unit on all data that of the lowest score, the first of equals."""
    return min((f for f in found if f.fold is None), key=lambda f: f.best.value)


def chosen_suite(
    file: Path, found: Sequence[Found], place: Path, objective: Objective | None = None
) -> str:
    """TOML of the suite of a file on one data set, with the settings chosen on all its data.

    place : where it will be written; the paths in it lead from there
    """
    import tomli_w

    document = tomllib.loads(file.read_text(encoding="utf-8"))
    own = found[0].unit.benchmark.dataset.name
    document["name"] = f"{document['name']}-tuned"
    document.pop("tune", None)
    document["datasets"] = [
        _moved(entry, file, place) for entry in document["datasets"] if _is(entry, file, own)
    ]
    units = {(f.unit.name, f.unit.recipe.name): f.unit.title for f in found}
    by_title = {own[0].unit.title: best_of(own) for own in by_unit(found)}
    entries: list[dict[str, Any]] = []
    for entry in document["identifiers"]:
        name = entry.get("name", str(entry["kind"]).rpartition(":")[2])
        plain = {key: value for key, value in entry.items() if key != "search"}
        if entry["kind"] == "published" and "file" in entry:
            plain["file"] = _from(file.parent / entry["file"], place)
        recipes = [recipe for own_name, recipe in units if own_name == name]
        if "search" not in entry or not recipes:
            entries.append(plain)
            continue
        for recipe in recipes:
            best = by_title[units[name, recipe]].best
            several = {"name": f"{name}-{recipe}", "recipes": [recipe]} if len(recipes) > 1 else {}
            entries.append({**plain, **best.settings, **several})
    document["identifiers"] = entries
    head = [
        f"# Settings tuned on {own}: {objective.words if objective else 'see summary.md'}.",
        "# They were chosen on all recordings: held-out scores of this suite are rather too good;",
        "# scores of tuning nested in the training folds stand in summary.md.",
    ]
    return "\n".join(head) + "\n" + tomli_w.dumps(document)


def _is(entry: Mapping[str, Any], file: Path, name: str) -> bool:
    """Whether an entry of a suite is the data set of a name."""
    from frictionid.data.readers.dataset import load_dataset

    if "name" in entry:
        return bool(entry["name"] == name)
    path = file.parent / entry["path"]
    return path.name == name or load_dataset(path).name == name


def _moved(entry: Mapping[str, Any], file: Path, place: Path) -> dict[str, Any]:
    out = dict(entry) | {"path": _from(file.parent / entry["path"], place)}
    if "tests" in entry:
        out["tests"] = [_from(file.parent / test, place) for test in entry["tests"]]
    return out


def _from(path: Path, place: Path) -> str:
    """A path as it leads from the folder of a file."""
    return Path(os.path.relpath(path.resolve(), place.parent.resolve())).as_posix()
