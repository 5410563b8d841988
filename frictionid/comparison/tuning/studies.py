"""Searches for settings: a study for each task, sampler and fold; the suite with the best."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

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
from frictionid.comparison.tuning.tuning_task import (
    TuningTask,
    protocol_for,
    score_trial,
    training_benchmark,
)
from frictionid.config import read_toml
from frictionid.errors import InputError
from frictionid.evaluation import Split
from frictionid.files import read_bytes


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


# --- The suite with the settings that were chosen


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
