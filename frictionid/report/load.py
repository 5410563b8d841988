"""Results of a comparison, sorted for reading: by data set, then identifier and recipe."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.results import task_documents
from frictionid.files import read_json

ROLES = ("none", "fitted", "given", "truth")
ANY = ""  # recipe of an entry that no recipe changes


class Key(NamedTuple):
    """Which score: see the columns of scores.csv."""

    score: str
    statistic: str
    horizon: float | None = None
    joint: str = "all"
    fold: str = "all"


class Scores(dict[Key, float]):
    """Values of scores by their keys; a missing one is NaN."""

    def __missing__(self, key: Key) -> float:
        return float("nan")

    def folds(self, key: Key) -> Array:
        """Values (F,) of a score in the folds that have it, in their order."""
        return np.array([self[key._replace(fold=fold)] for fold in self.fold_names(key)])

    def fold_names(self, key: Key) -> list[str]:
        """Names of the folds that have a score, in their order."""
        names = {k.fold for k in self if k.fold != "all" and k == key._replace(fold=k.fold)}
        return sorted(names, key=lambda name: (len(name), name))


@dataclass(frozen=True, eq=False)
class Entry:
    """One line of a table: an identifier with the recipe by which it was fitted.

    role : "none" (no friction), "fitted", "given" (fixed numbers) or "truth"
    recipe : its name, or "" where no recipe plays a part
    label : the identifier's name, with the seed where seeds differ
    scores : by the data set they were scored on
    """

    identifier: str
    recipe: str
    role: str
    label: str
    scores: Mapping[str, Scores]
    curves: Array  # (F + 1, V, n) [N m], the friction of all data last
    motions: Sequence[Mapping[str, Any]]
    theta: Array  # (F, n, P)
    model: Mapping[str, Any]
    settings: Mapping[str, str]  # constructor calls of identifier and recipe
    refined: Mapping[str, Any] | None = None  # what shooting found, where it did
    members: Array | None = None  # (N, V, n) [N m], the curves of an ensemble's members, all data
    loops: Sequence[Mapping[str, Any]] = ()  # friction along sinusoids, where it was asked for
    way: Mapping[str, Any] = field(default_factory=dict)  # scheme, and what corrects its data

    @property
    def title(self) -> str:
        """Label and recipe as they stand in sentences."""
        return f"{self.label} ({self.recipe})" if self.recipe else self.label


class Section(NamedTuple):
    """Everything that was fitted to one data set; `tests` are data sets that no fit has seen."""

    dataset: str
    tests: tuple[str, ...]
    recipes: tuple[str, ...]
    entries: tuple[Entry, ...]

    def of_role(self, *roles: str) -> list[Entry]:
        """Entries of some roles, in their order."""
        return [entry for entry in self.entries if entry.role in roles]

    def under(self, recipe: str) -> list[Entry]:
        """Entries that belong beside a recipe: its own, and those that no recipe changes."""
        return [entry for entry in self.entries if entry.recipe in (ANY, recipe)]


class Evidence(NamedTuple):
    """A whole comparison; `about` has the entry of datasets.json of each data set."""

    provenance: Mapping[str, Any]
    about: Mapping[str, Mapping[str, Any]]
    sections: tuple[Section, ...]
    missing: tuple[str, ...]

    @property
    def horizons(self) -> list[float]:
        """Horizons of the rollouts [s], ascending."""
        scores = [s for part in self.sections for e in part.entries for s in e.scores.values()]
        return horizons_of(scores)


def folds_told(provenance: Mapping[str, Any], dataset: str) -> Mapping[str, Any]:
    """The table of folds that a suite has for a data set: its own, or that of all."""
    settings = provenance.get("settings", {})
    for entry in settings.get("datasets", ()):
        name = entry.get("name") or str(entry.get("path", "")).rpartition("/")[2]
        if name == dataset and entry.get("folds"):
            own: Mapping[str, Any] = entry["folds"]
            return own
    common: Mapping[str, Any] = settings.get("folds", {})
    return common


def horizons_of(scores: Iterable[Scores]) -> list[float]:
    """All horizons [s] that some scores have, ascending."""
    return sorted({key.horizon for part in scores for key in part if key.horizon is not None})


def scores_of(rows: Iterable[Sequence[Any]]) -> Scores:
    """Scores of the rows of a result file: fold, score, statistic, horizon, joint, value, unit.

    >>> scores = scores_of([["0", "rollout_angle", "q90", 0.5, "all", "inf", "rad"]])
    >>> scores.folds(Key("rollout_angle", "q90", 0.5))
    array([inf])
    """
    out = Scores()
    for fold, score, statistic, horizon, joint, value, _ in rows:
        known = horizon is not None and horizon == horizon
        key = Key(score, statistic, float(horizon) if known else None, str(joint), str(fold))
        out[key] = float("nan") if value is None else float(value)
    return out


def gather(folder: Path) -> Evidence:
    """All that the report needs of a result folder.

    Raises
    ------
    InputError
        Where the folder holds no comparison, or none of its tasks is finished.
    """
    provenance = read_json(folder / "provenance.json")
    about = read_json(folder / "datasets.json")
    tasks = task_documents(folder)
    datasets = list(dict.fromkeys(task["dataset"] for task in tasks))
    parts = [_section(name, [t for t in tasks if t["dataset"] == name]) for name in datasets]
    missing = [name for name in provenance["tasks"] if not (folder / "tasks" / name).exists()]
    return Evidence(provenance, about, tuple(parts), tuple(missing))


def _section(dataset: str, tasks: Sequence[Mapping[str, Any]]) -> Section:
    tests = dict.fromkeys(name for task in tasks for name in task["rows"] if name != dataset)
    entries: list[Entry] = []
    for task in tasks:
        entry = _entry(task, tasks)
        if not any(_same(entry, other) for other in entries):
            entries.append(entry)
    recipes = tuple(dict.fromkeys(str(task["fit"]) for task in tasks))
    place = {recipe: i for i, recipe in enumerate((ANY, *recipes))}
    entries.sort(key=lambda e: (ROLES.index(e.role), place[e.recipe]))
    return Section(dataset, tuple(tests), recipes, tuple(entries))


def _entry(task: Mapping[str, Any], tasks: Sequence[Mapping[str, Any]]) -> Entry:
    theta = np.asarray(task["folds"]["theta"], dtype=float).reshape(task["folds"]["shape"])
    overall = np.asarray(task["model"]["theta"], dtype=float).reshape(task["model"]["shape"])
    name, role = str(task["identifier"]), _role(task, theta, overall)
    twins = [t for t in tasks if t["identifier"] == name and t["fit"] == task["fit"]]
    differ = any(t["folds"]["theta"] != task["folds"]["theta"] for t in twins)
    return Entry(
        identifier=name,
        recipe=str(task["fit"]) if role == "fitted" else ANY,
        role=role,
        label=f"{name}, seed {task['seed']}" if differ else name,
        scores={dataset: scores_of(rows) for dataset, rows in task["rows"].items()},
        curves=np.asarray(task["curves"], dtype=float),
        motions=task["motions"],
        theta=theta,
        model=task["model"],
        settings=task["settings"],
        refined=task.get("refined") or None,
        members=np.asarray(task["members"], dtype=float) if task.get("members") else None,
        loops=task.get("loops") or (),
        way=task.get("way") or {},
    )


def _role(task: Mapping[str, Any], theta: Array, overall: Array) -> str:
    if task["model"].get("provenance", {}).get("source") == "truth":
        return "truth"
    if not overall.size:
        return "none"
    # numbers that no fold changes were not fitted
    return "given" if np.array_equal(theta, np.broadcast_to(overall, theta.shape)) else "fitted"


def _same(entry: Entry, other: Entry) -> bool:
    """Whether two entries are one: seeds that changed nothing, fixed numbers under two recipes."""
    names = entry.identifier == other.identifier and entry.recipe == other.recipe
    return names and np.array_equal(entry.theta, other.theta)
