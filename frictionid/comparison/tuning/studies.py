"""Searches for settings: a study for each tuning task, sampler and fold."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from frictionid.arrays import Array
from frictionid.comparison.cross_validate import Benchmark, PreparedBenchmark, prepare_benchmark
from frictionid.comparison.processes import side_by_side
from frictionid.comparison.search_space import Objective, Tuning
from frictionid.comparison.tasks import Task
from frictionid.comparison.tuning.journal import (
    Study,
    Trial,
    as_params,
    open_journal,
    open_study,
    readable_journal,
)
from frictionid.comparison.tuning.tuning_task import TuningTask, protocol_for, score_trial
from frictionid.data.recordings import Dataset, Recording
from frictionid.data.signals import Signal
from frictionid.errors import InputError
from frictionid.evaluation import Split, make_folds


def training_benchmark(benchmark: Benchmark, fold: int | None, inner: Split) -> Benchmark:
    """A benchmark among the recordings that train a fold, all of them for None; held-out ones test.

    The truth of simulated data is left out: nothing is tuned to it.

    Raises
    ------
    InputError
        For shuffled folds, where every held-out sample has neighbours in the training set.
    """
    dataset = benchmark.dataset
    whole = replace(dataset, truth=None, recordings=tuple(map(_without_truth, dataset.recordings)))
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
    unseen = _pieces_in_use(whole, _held_out(benchmark, fold), shortest)
    tests = () if unseen is None else (replace(unseen, name=f"{dataset.name}, held out"),)
    return _inner_benchmark(seen, benchmark, inner, tests)


def _inner_benchmark(
    dataset: Dataset, benchmark: Benchmark, inner: Split, tests: tuple[Dataset, ...]
) -> Benchmark:
    few = len(dataset.recordings) < inner.folds(len(dataset.recordings))
    split = replace(inner, kind="blocks") if few else inner
    return Benchmark(dataset, make_folds(dataset.recordings, split), benchmark.protocol, tests)


def _without_truth(recording: Recording) -> Recording:
    return replace(recording, truth=None)


def _training(benchmark: Benchmark, fold: int) -> list[Array]:
    """Whether each interval of each recording trains a fold."""
    out = []
    for i, time in enumerate(benchmark.folds.times):
        rows = np.full(len(time) - 1, i)
        out.append(benchmark.folds.training(rows, time[:-1], np.diff(time))[fold] > 0)
    return out


def _held_out(benchmark: Benchmark, fold: int) -> list[Array]:
    return [label[:-1] == fold for label in benchmark.folds.labels]


def _pieces_in_use(dataset: Dataset, use: list[Array], shortest: float) -> Dataset | None:
    """The pieces of recordings that consist of intervals in use, without those too short."""
    pieces = [
        piece
        for recording, intervals in zip(dataset.recordings, use, strict=True)
        for piece in _pieces(recording, intervals)
        if piece.angle.time[-1] - piece.angle.time[0] >= shortest - 1e-9
    ]
    return replace(dataset, recordings=tuple(pieces)) if pieces else None


def _pieces(recording: Recording, use: Array) -> Iterator[Recording]:
    if use.all():
        yield recording
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[0], use.astype(int), [0]])))
    for number, (first, last) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        angle = _between(recording.angle, int(first), int(last) + 1)
        yield replace(recording, name=f"{recording.name}, piece {number}", angle=angle)


def _between(signal: Signal, first: int, stop: int) -> Signal:
    each = signal.sigma is not None and np.ndim(signal.sigma) == 2
    sigma = np.asarray(signal.sigma)[first:stop] if each else signal.sigma
    return Signal(signal.time[first:stop], signal.value[first:stop], signal.hold, sigma)


class StudySpec(NamedTuple):
    """A study to be made: a tuning task with a sampler, nested in an outer fold or on all data."""

    task: TuningTask
    sampler: str
    fold: int | None

    @property
    def name(self) -> str:
        """Name of the study in the journal."""
        part = "all data" if self.fold is None else f"without fold {self.fold}"
        return f"{self.task.title}, {self.sampler}, {part}"


class StudyResult(NamedTuple):
    """Trials of a study, and scores on the outer fold that it is nested in, None for all data.

    suite_value : score of the suite's settings on the inner folds, NaN where the space lacks them
    held_out, held_out_suite : scores of the best and of the suite's settings on the held-out fold
    """

    task: TuningTask
    sampler: str
    fold: int | None
    trials: tuple[Trial, ...]
    suite_value: float
    held_out: float
    held_out_suite: float

    @property
    def best(self) -> Trial:
        """The trial of the lowest score, the first of equals."""
        return best_trial(self.trials)


def best_trial(trials: Sequence[Trial]) -> Trial:
    """The trial of the lowest score, the first of equals; failed ones come last."""
    return min(trials, key=lambda t: math.inf if math.isnan(t.value) else t.value)


def study_specs(tasks: Sequence[TuningTask], tuning: Tuning) -> list[StudySpec]:
    """Studies of each task with each sampler, on all data and, where nested, for each fold."""
    return [
        StudySpec(task, sampler, fold)
        for task in tasks
        for sampler in tuning.samplers
        for fold in (None, *(range(task.benchmark.folds.count) if tuning.nested else ()))
    ]


@dataclass(frozen=True, eq=False)
class NestedData:
    """What studies may see of their data sets, prepared once for all studies that see the same."""

    tuning: Tuning
    _benchmarks: dict[tuple[str, int | None], Benchmark] = field(default_factory=dict)
    _prepared: dict[tuple[str, int | None, str], PreparedBenchmark] = field(default_factory=dict)

    def benchmark(self, spec: StudySpec) -> Benchmark:
        """Inner folds of the recordings that train the study's fold; its held-out ones test."""
        outer = spec.task.benchmark
        key = outer.dataset.name, spec.fold
        if key not in self._benchmarks:
            protocol = protocol_for(self.tuning.objective, outer.protocol)
            gap = outer.folds.gap or Split().gap
            inner = Split(self.tuning.folds, "recordings", gap, self.tuning.seed)
            nested = training_benchmark(replace(outer, protocol=protocol), spec.fold, inner)
            self._benchmarks[key] = nested
        return self._benchmarks[key]

    def call(
        self, spec: StudySpec, settings: Mapping[str, Any], tests: bool
    ) -> tuple[Task, PreparedBenchmark, Objective]:
        """Arguments of `score_trial`; held-out recordings are there for `tests` only."""
        benchmark = self.benchmark(spec)
        key = spec.task.benchmark.dataset.name, spec.fold, spec.task.recipe.name
        if key not in self._prepared:
            self._prepared[key] = prepare_benchmark(benchmark, [spec.task.recipe])
        shared = self._prepared[key]
        if not tests:
            benchmark, shared = replace(benchmark, tests=()), shared._replace(tests=())
        return spec.task.task(benchmark, settings), shared, self.tuning.objective


def tune(
    tasks: Sequence[TuningTask],
    tuning: Tuning,
    folder: Path,
    *,
    resume: bool = False,
    replace_trials: bool = False,
    jobs: int = 1,
    done: Callable[[str], None] | None = None,
) -> list[StudyResult]:
    """Results of all studies of the tasks.

    Parameters
    ----------
    tasks : sequence of TuningTask
    tuning : Tuning
    folder : Path
        Of the journal.
    resume : bool
        Keep the trials that the journal has.
    replace_trials : bool
        Remove the trials that the journal has.
    jobs : int
        Trials side by side.
    done : callable, optional
        Called with the name of the study of each finished trial.

    Raises
    ------
    InputError
        Where folds, data and settings do not fit together, or no trial of a study has a score.
    """
    report = done or (lambda _: None)
    specs, data = study_specs(tasks, tuning), NestedData(tuning)
    with readable_journal(folder):
        storage = open_journal(folder, resume=resume, replace=replace_trials)
        studies = [_study(storage, spec, data) for spec in specs]
        for study in studies:
            _ = study.trials, study.held_out
    for spec, study in zip(specs, studies, strict=True):
        for _ in study.trials[: tuning.trials]:
            report(spec.name)
    while open_ := [i for i, study in enumerate(studies) if len(study.trials) < tuning.trials]:
        asked = [studies[i].ask() for i in open_]
        pairs = zip(open_, asked, strict=True)
        calls = [data.call(specs[i], settings, tests=False) for i, (_, settings) in pairs]
        for place, score in side_by_side(score_trial, calls, jobs):
            studies[open_[place]].tell(asked[place][0], score.value, score.error)
            report(specs[open_[place]].name)
    _score_held_out(specs, studies, data, jobs)
    return [_result(spec, study) for spec, study in zip(specs, studies, strict=True)]


def _study(storage: Any, spec: StudySpec, data: NestedData) -> Study:
    """The study of a spec, as the journal has it, or anew where data or settings differ."""
    search, suite = spec.task.search, spec.task.suite_settings
    held = all(key in suite and space.holds(suite[key]) for key, space in search.items())
    first = as_params(search, suite) if held else None
    study = open_study(storage, spec.name, _digest(spec, data), first)
    return Study(study, search, spec.sampler, data.tuning.seed)


def _digest(spec: StudySpec, data: NestedData) -> str:
    """SHA-256 of all that a study depends on."""
    search, tuning = spec.task.search, data.tuning
    first = {key: space.ends[0] for key, space in search.items()}
    task = spec.task.task(data.benchmark(spec), first)
    spaces = {key: space.words for key, space in search.items()}
    words = json.dumps([spaces, spec.task.suite_settings, tuning.objective.words, tuning.seed])
    return hashlib.sha256(f"{task.digest} {words} {spec.sampler}".encode()).hexdigest()


def _score_held_out(
    specs: Sequence[StudySpec], studies: Sequence[Study], data: NestedData, jobs: int
) -> None:
    """Score on each fold what was chosen without it, beside the suite's settings."""
    nested = [
        (spec, study)
        for spec, study in zip(specs, studies, strict=True)
        if spec.fold is not None and study.held_out is None
    ]
    calls = [
        data.call(spec, settings, tests=True)
        for spec, study in nested
        for settings in (_best(spec, study).settings, {})
    ]
    scores: dict[int, float | None] = {}
    for i, score in side_by_side(score_trial, calls, jobs):
        scores[i] = score.held_out if math.isfinite(score.held_out) else None
        first = i - i % 2  # of the two calls of a study
        if first in scores and first + 1 in scores:
            nested[i // 2][1].set_held_out({"chosen": scores[first], "suite": scores[first + 1]})


def _best(spec: StudySpec, study: Study) -> Trial:
    best = best_trial(study.trials)
    if math.isnan(best.value):
        raise InputError(f"{spec.name}: no trial has a score: {study.trials[0].error}")
    return best


def _result(spec: StudySpec, study: Study) -> StudyResult:
    _best(spec, study)
    of_suite = [trial.value for trial in study.trials if trial.of_suite]
    held = study.held_out or {}
    scores = [math.nan if (v := held.get(key)) is None else v for key in ("chosen", "suite")]
    suite_value = of_suite[-1] if of_suite else math.nan
    return StudyResult(*spec, study.trials, suite_value, *scores)
