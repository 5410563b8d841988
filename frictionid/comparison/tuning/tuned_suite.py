"""The suite with the settings that tuning chose."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from frictionid.comparison.search_space import Objective
from frictionid.comparison.tuning.studies import StudyResult
from frictionid.config import read_toml
from frictionid.files import read_bytes


def by_task(results: Sequence[StudyResult]) -> list[list[StudyResult]]:
    """Results grouped by what they tune."""
    return [list(group) for _, group in groupby(results, key=lambda r: r.task.title)]


def best_of(results: Sequence[StudyResult]) -> StudyResult:
    """Of the studies of one task on all data that of the lowest score, the first of equals."""
    return min((r for r in results if r.fold is None), key=lambda r: r.best.value)


def chosen_suite(
    file: Path, results: Sequence[StudyResult], place: Path, objective: Objective | None = None
) -> str:
    """TOML of the suite of a file on one data set, with the settings chosen on all its data.

    place : where it will be written; the paths in it lead from there
    """
    import tomli_w

    document = read_toml(file)
    name = results[0].task.benchmark.dataset.name
    document["name"] = f"{document['name']}-tuned"
    document.pop("tune", None)
    document["datasets"] = [
        _moved(entry, file, place) for entry in document["datasets"] if _is(entry, file, name)
    ]
    best = [best_of(task_results) for task_results in by_task(results)]
    document["identifiers"] = [
        entry for table in document["identifiers"] for entry in _chosen(table, best, file, place)
    ]
    head = [
        f"# Settings tuned on {name}: {objective.words if objective else 'see summary.md'}.",
        "# They were chosen on all recordings: held-out scores of this suite are rather too good;",
        "# scores of tuning nested in the training folds stand in summary.md.",
    ]
    return "\n".join(head) + "\n" + tomli_w.dumps(document)


def own_modules(file: Path) -> dict[str, bytes]:
    """Modules beside a suite that its identifiers are of, by name: a copy of it needs them, too."""
    kinds = [str(entry.get("kind")) for entry in read_toml(file)["identifiers"]]
    names = {f"{kind.partition(':')[0].partition('.')[0]}.py" for kind in kinds if ":" in kind}
    paths = [file.parent / name for name in sorted(names)]
    return {path.name: read_bytes(path) for path in paths if path.is_file()}


def _chosen(
    table: Mapping[str, Any], best: Sequence[StudyResult], file: Path, place: Path
) -> list[dict[str, Any]]:
    """An identifier's table with the settings chosen, one for each recipe that tuned it."""
    entry = {key: value for key, value in table.items() if key != "search"}
    if entry["kind"] == "published" and "file" in entry:
        entry["file"] = _from(file.parent / entry["file"], place)
    name = entry.get("name", str(entry["kind"]).rpartition(":")[2])
    chosen = [result for result in best if result.task.name == name]
    if "search" not in table or not chosen:
        return [entry]
    if len(chosen) == 1:
        return [{**entry, **chosen[0].best.settings}]
    return [
        {**entry, **r.best.settings, "name": f"{name}-{recipe}", "recipes": [recipe]}
        for r in chosen
        for recipe in [r.task.recipe.name]
    ]


def _is(entry: Mapping[str, Any], file: Path, name: str) -> bool:
    """Whether an entry of a suite is the data set of a name."""
    from frictionid.data.readers.dataset_path import dataset_path

    if "name" in entry:
        return bool(entry["name"] == name)
    path = file.parent / entry["path"]
    return path.name == name or read_toml(dataset_path(path)).get("name") == name


def _moved(entry: Mapping[str, Any], file: Path, place: Path) -> dict[str, Any]:
    out = dict(entry) | {"path": _from(file.parent / entry["path"], place)}
    if "tests" in entry:
        out["tests"] = [_from(file.parent / test, place) for test in entry["tests"]]
    return out


def _from(path: Path, place: Path) -> str:
    """A path as it leads from the folder of a file."""
    return Path(os.path.relpath(path.resolve(), place.parent.resolve())).as_posix()
