"""What is tuned, an identifier by a recipe on one data set, and what a trial of it is."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from frictionid.comparison.cross_validate import Benchmark, Method, PreparedBenchmark, run
from frictionid.comparison.registry import IDENTIFIERS
from frictionid.comparison.search_space import Objective, Space
from frictionid.comparison.suite import (
    IdentifierEntry,
    Suite,
    benchmark_of,
    identifier_of,
    recipes_of,
    used_of,
    with_settings,
)
from frictionid.comparison.tasks import Task
from frictionid.config import distinct
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, score_value

NEVER = 1e6  # [s] between starts: one in each recording, where no rollout is asked for


@dataclass(frozen=True, eq=False)
class TuningTask:
    """An identifier with settings to search, by a recipe on a data set with its folds."""

    benchmark: Benchmark
    name: str
    entry: IdentifierEntry
    recipe: Method
    seed: int
    folder: Path

    @property
    def search(self) -> Mapping[str, Space]:
        """Space of each setting to search."""
        return self.entry.search or {}

    @property
    def title(self) -> str:
        """What names the unit in studies and tables."""
        return f"{self.benchmark.dataset.name}: {self.name}, {self.recipe.name}"

    @property
    def own(self) -> dict[str, Any]:
        """Settings as the suite, or else the identifier itself, has them."""
        given = self.entry.model_extra or {}
        usual = {}
        if self.entry.kind in IDENTIFIERS:
            known = inspect.signature(IDENTIFIERS[self.entry.kind]).parameters
            usual = {k: p.default for k, p in known.items() if p.default is not p.empty}
        both = {**usual, **given}
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in both.items()}
        return {key: plain[key] for key in self.search if plain.get(key) is not None}

    def task(self, benchmark: Benchmark, settings: Mapping[str, Any]) -> Task:
        """The task of one trial, on what tuning may see of the data."""
        entry = with_settings(self.entry, {**(self.entry.model_extra or {}), **settings})
        _, identifier, _ = identifier_of(entry, self.folder, [self.recipe])
        return Task(benchmark, self.name, identifier, self.recipe, self.seed)


def tuning_tasks(suite: Suite, file: Path, data: Path | None = None) -> list[TuningTask]:
    """What a suite has to tune: its identifiers with a `search` table, all spaces checked.

    Raises
    ------
    InputError
        Where nothing is to be searched, or an end of a space is no value of its setting.
    """
    try:
        return _units(suite, file.parent, data)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _units(suite: Suite, folder: Path, data: Path | None) -> list[TuningTask]:
    entries = [entry for entry in suite.identifiers if entry.search]
    if not entries:
        raise InputError(
            "no identifier has a search table: add one, e.g. "
            "search = { width = { low = 0.005, high = 0.1, log = true } }"
        )
    recipes = recipes_of(suite.recipes)
    for entry in entries:
        _check(entry, folder, recipes)
    parts = [benchmark_of(suite, entry, folder, data) for entry in suite.datasets]
    benchmarks = [replace(benchmark, tests=()) for benchmark in parts]
    units = []
    for benchmark, told in zip(benchmarks, suite.datasets, strict=True):
        for recipe in used_of(told, recipes):
            for entry in entries:
                name, _, only = identifier_of(with_settings(entry, _plain(entry)), folder, recipes)
                if only is None or recipe.name in only:
                    units.append(TuningTask(benchmark, name, entry, recipe, suite.seeds[0], folder))
    distinct([unit.title for unit in units], "identifiers to tune")
    return units


def _plain(entry: IdentifierEntry) -> dict[str, Any]:
    """Settings that make an identifier: the suite's, and of those searched that it lacks the first.

    A setting without a default may be left to the search.
    """
    given = dict(entry.model_extra or {})
    return {**{key: space.ends[0] for key, space in (entry.search or {}).items()}, **given}


def _check(entry: IdentifierEntry, folder: Path, recipes: Sequence[Method]) -> None:
    plain = _plain(entry)
    for key, space in (entry.search or {}).items():
        for value in space.ends:
            try:
                identifier_of(with_settings(entry, {**plain, key: value}), folder, recipes)
            except InputError as error:
                raise InputError(f"{error} (search.{key} at {value!r})") from None


class Judged(NamedTuple):
    """What a trial scored: on inner folds, and on recordings held out from tuning; or its error."""

    value: float
    held_out: float
    error: str = ""


def judged(task: Task, shared: PreparedBenchmark, objective: Objective) -> Judged:
    """Scores of a task, an identifier that finds no numbers has none."""
    try:
        result = run(task.benchmark, task.identifier, task.recipe, task.seed, shared)
        value = result.value(*objective.key)
    except InputError as error:
        return Judged(math.nan, math.nan, str(error))
    return Judged(value, _first(result.tests.values(), objective))


def _first(frames: Iterable[pd.DataFrame], objective: Objective) -> float:
    """The objective in the first score frame that has it, NaN where none does."""
    for frame in frames:
        with suppress(InputError):
            return score_value(frame, *objective.key)
    return math.nan


def protocol_for(objective: Objective, protocol: Protocol) -> Protocol:
    """The protocol with as many rollouts as the objective needs."""
    protocol = replace(protocol, whole=False, true_initial_states=False)
    if objective.horizon is None:
        least = (min(protocol.horizons),)
        return replace(protocol, horizons=least, every=NEVER, initial_states="filter")
    return replace(protocol, horizons=(objective.horizon,))
