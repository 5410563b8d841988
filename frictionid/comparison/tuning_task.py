"""Tuning tasks: an identifier by a recipe on a data set, scored on what tuning may see of it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.config import distinct
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import run_edges, taken
from frictionid.errors import InputError, located
from frictionid.evaluation import Protocol, Split, make_folds, score_value

from .cross_validate import Benchmark, PreparedBenchmark, run
from .registry import IDENTIFIERS
from .search_space import Objective, Space
from .suite import IdentifierEntry, Suite, benchmarks_of, identifier_of, used_recipes
from .suite_recipes import recipes_of
from .tasks import Task
from .training_set import Method

NEVER = 1e6  # [s] between starts: one in each recording, where no rollout is asked for


class TuningTask(NamedTuple):
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
        """Name of the task in studies and tables."""
        return f"{self.benchmark.dataset.name}: {self.name}, {self.recipe.name}"

    @property
    def suite_settings(self) -> dict[str, Any]:
        """Settings to search as the suite, or else the identifier's defaults, have them."""
        settings, kind = self.entry.table, IDENTIFIERS.get(self.entry.kind)
        both = {**(kind.defaults(settings) if kind else {}), **settings}
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in both.items()}
        return {key: plain[key] for key in self.search if plain.get(key) is not None}

    def task(self, benchmark: Benchmark, settings: Mapping[str, Any]) -> Task:
        """The task of one trial, on what tuning may see of the data."""
        entry = self.entry.with_settings(settings)
        # its code was trusted when the task was made
        identifier = identifier_of(entry, self.folder, [self.recipe], trust=True).identifier
        return Task(benchmark, self.name, identifier, self.recipe, self.seed)


def tuning_tasks(
    suite: Suite, file: Path, data: Path | None = None, *, trust: bool = False
) -> list[TuningTask]:
    """What a suite has to tune: its identifiers with a `search` table, all spaces checked.

    Raises
    ------
    InputError
        Where nothing is to be searched, or an end of a space is no value of its setting.
    """
    folder, entries = file.parent, [entry for entry in suite.identifiers if entry.search]
    with located(str(file)):
        if not entries:
            raise InputError(
                "no identifier has a search table: add one, e.g. "
                "search = { width = { low = 0.005, high = 0.1, log = true } }"
            )
        recipes = recipes_of(suite.recipes, folder)
        for entry in entries:
            _check_space(entry, folder, recipes, trust)
        benchmarks = [b._replace(tests=()) for b in benchmarks_of(suite, folder, data, trust=trust)]
        tasks = [
            TuningTask(benchmark, entry.label, entry, recipe, suite.seeds[0], folder)
            for dataset, benchmark in zip(suite.datasets, benchmarks, strict=True)
            for recipe in used_recipes(dataset, recipes)
            for entry in entries
            if entry.recipes is None or recipe.name in entry.recipes
        ]
        distinct([task.title for task in tasks], "identifiers to tune")
    return tasks


def _check_space(
    entry: IdentifierEntry, folder: Path, recipes: Sequence[Method], trust: bool
) -> None:
    """Check that each setting to search takes the ends of its space.

    A setting without a default may be left to the search: it has an end while others are checked.
    """
    search = entry.search or {}
    first = {key: space.ends[0] for key, space in search.items()}
    complete = entry.with_settings({**first, **entry.table})
    for key, space in search.items():
        for value in space.ends:
            try:
                identifier_of(complete.with_settings({key: value}), folder, recipes, trust=trust)
            except InputError as error:
                raise InputError(f"{error} (search.{key} at {value!r})") from None


def score_trial(
    task: Task, shared: PreparedBenchmark, objective: Objective
) -> tuple[float, float, str]:
    """Objective of a task on inner folds, and on recordings held out from tuning, or its error.

    NaN where the fit failed, or the held-out recordings have no such score.
    """
    held_out = math.nan
    try:
        result = run(task.benchmark, task.identifier, task.recipe, task.seed, shared)
        value = result.value(*objective.key)
    except InputError as error:
        return math.nan, held_out, str(error)
    with suppress(InputError):
        for frame in result.tests.values():
            held_out = score_value(frame, *objective.key)
    return value, held_out, ""


def protocol_for(objective: Objective, protocol: Protocol) -> Protocol:
    """The protocol with as many rollouts as the objective needs."""
    protocol = replace(protocol, whole=False, true_initial_states=False)
    if objective.horizon is None:
        shortest = (min(protocol.horizons),)
        return replace(protocol, horizons=shortest, every=NEVER, initial_states="filter")
    return replace(protocol, horizons=(objective.horizon,))


def training_benchmark(benchmark: Benchmark, fold: int | None, inner: Split) -> Benchmark:
    """A benchmark among the recordings that train a fold, all of them for None; held-out ones test.

    The truth of simulated data is left out: nothing is tuned to it.

    Raises
    ------
    InputError
        For shuffled folds, where every held-out sample has neighbours in the training set.
    """
    dataset = benchmark.dataset
    recordings = tuple(replace(r, truth=None) for r in dataset.recordings)
    whole = replace(dataset, truth=None, recordings=recordings)
    if fold is None:
        return _inner_benchmark(whole, benchmark, inner, ())
    if not benchmark.folds.contiguous:
        raise InputError(
            "tuning is nested in the training folds, which shuffled samples do not part: set "
            'folds.kind = "recordings" or "blocks", or tune.nested = false'
        )
    shortest = benchmark.protocol.history + min(benchmark.protocol.horizons)
    seen = _pieces_in_use(whole, _training(benchmark, fold), shortest)
    if seen is None:
        raise InputError(
            f"data set {dataset.name!r}: fold {fold} leaves no {shortest:g} s of motion in one "
            "piece to tune on: use fewer folds"
        )
    unseen = _pieces_in_use(
        whole, [label[:-1] == fold for label in benchmark.folds.labels], shortest
    )
    tests = () if unseen is None else (replace(unseen, name=f"{dataset.name}, held out"),)
    return _inner_benchmark(seen, benchmark, inner, tests)


def _inner_benchmark(
    dataset: Dataset, benchmark: Benchmark, inner: Split, tests: tuple[Dataset, ...]
) -> Benchmark:
    few = len(dataset.recordings) < inner.folds(len(dataset.recordings))
    split = replace(inner, kind="blocks") if few else inner
    return Benchmark(dataset, make_folds(dataset.recordings, split), benchmark.protocol, tests)


def _training(benchmark: Benchmark, fold: int) -> list[Array]:
    """Whether each interval of each recording trains a fold."""
    out = []
    for i, time in enumerate(benchmark.folds.times):
        rows = np.full(len(time) - 1, i)
        out.append(benchmark.folds.training(rows, time[:-1], np.diff(time))[fold] > 0)
    return out


def _pieces_in_use(dataset: Dataset, use: list[Array], shortest: float) -> Dataset | None:
    """The pieces of recordings that consist of intervals in use, without those too short."""
    pieces = [
        piece
        for recording, intervals in zip(dataset.recordings, use, strict=True)
        for piece in _pieces(recording, intervals)
        if piece.angle.duration >= shortest - 1e-9
    ]
    return replace(dataset, recordings=tuple(pieces)) if pieces else None


def _pieces(recording: Recording, use: Array) -> Iterator[Recording]:
    if use.all():
        yield recording
        return
    for number, (first, last) in enumerate(zip(*run_edges(use), strict=True)):
        angle = taken(recording.angle, np.arange(first, last + 1))
        yield replace(recording, name=f"{recording.name}, piece {number}", angle=angle)
