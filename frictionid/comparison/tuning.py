"""Searches for settings: a study for each task, sampler and fold; the suite with the best."""

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.config import read_toml
from frictionid.errors import InputError
from frictionid.evaluation import Split
from frictionid.files import read_bytes, sha256

from .cross_validate import Benchmark, PreparedBenchmark, prepare_benchmark
from .processes import side_by_side
from .search_space import (
    LARGEST,
    Objective,
    Trial,
    Tuning,
    distribution_of,
    open_journal,
    open_study,
    readable_journal,
    sampler_of,
    text_of,
)
from .tasks import Task
from .tuning_task import TuningTask, protocol_for, score_trial, training_benchmark

Spec = tuple[TuningTask, str, int | None]  # what is tuned, sampler, outer fold, None for all data


class Study(NamedTuple):
    """A search in the journal: a tuning task with a sampler, on all data or nested in a fold.

    Attributes
    ----------
    fold : outer fold whose held-out recordings the search does not see, None for all data
    seed : of the search
    record : Optuna's study
    """

    task: TuningTask
    sampler: str
    fold: int | None
    seed: int
    record: Any

    @property
    def name(self) -> str:
        """Name of the study in the journal."""
        return str(self.record.study_name.rpartition(" [")[0])

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Finished trials in their order, without those that were interrupted."""
        return tuple(map(self._trial, self._finished()))

    @property
    def best(self) -> Trial:
        """The trial of the lowest score, the first of equals.

        Raises
        ------
        InputError
            Where no trial has a score.
        """
        trials = self.trials
        best = min(trials, key=lambda t: math.inf if math.isnan(t.value) else t.value)
        if math.isnan(best.value):
            raise InputError(f"{self.name}: no trial has a score: {trials[0].error}")
        return best

    @property
    def suite_value(self) -> float:
        """Score of the suite's settings on the inner folds, NaN where the space lacks them."""
        values = [trial.value for trial in self.trials if trial.of_suite]
        return values[-1] if values else math.nan

    @property
    def held_out(self) -> float:
        """Score of the best settings on the held-out fold, NaN of all data."""
        return self._held_out("chosen")

    @property
    def held_out_suite(self) -> float:
        """Score of the suite's settings on the held-out fold, NaN of all data."""
        return self._held_out("suite")

    def ask(self) -> tuple[Any, dict[str, Any]]:
        """The next trial, and its settings."""
        # anew for each trial: what it proposes does not depend on interruptions
        self.record.sampler = sampler_of(self.sampler, self.seed, len(self._finished()))
        search = self.task.search
        trial = self.record.ask({k: distribution_of(space) for k, space in search.items()})
        return trial, self._settings(trial.params)

    def tell(self, trial: Any, value: float, error: str) -> None:
        """Write a trial's score or, where it has none, why."""
        from optuna.trial import TrialState

        if abs(value) < LARGEST:
            self.record.tell(trial, value)
            return
        trial.set_user_attr("error", error or f"its score is {value}")
        self.record.tell(trial, state=TrialState.FAIL)

    def _held_out(self, name: str) -> float:
        value = self.record.user_attrs.get("held_out", {}).get(name)
        return math.nan if value is None else value

    def _finished(self) -> list[Any]:
        """Trials that have a score or failed, but for those that were interrupted."""
        from optuna.trial import TrialState

        states = (TrialState.COMPLETE, TrialState.FAIL)
        trials = self.record.get_trials(deepcopy=False, states=states)
        return [t for t in trials if not t.user_attrs.get("interrupted")]

    def _trial(self, trial: Any) -> Trial:
        value = math.nan if trial.value is None else float(trial.value)
        if abs(value) >= LARGEST:
            raise ValueError(f"no trial has the score {value}")
        error, of_suite = (trial.user_attrs.get(key) for key in ("error", "suite"))
        return Trial(self._settings(trial.params), value, str(error or ""), bool(of_suite))

    def _settings(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Parameters of Optuna as settings: choices are stored as texts."""
        out = {}
        for key, space in self.task.search.items():
            choices = {text_of(choice): choice for choice in space.choices or ()}
            out[key] = choices[params[key]] if choices else params[key]
        return out


def study_specs(tasks: Sequence[TuningTask], tuning: Tuning) -> list[Spec]:
    """Studies of each task with each sampler, on all data and, where nested, for each fold."""
    return [
        (task, sampler, fold)
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

    def benchmark(self, task: TuningTask, fold: int | None) -> Benchmark:
        """Inner folds of the recordings that train an outer fold; its held-out ones test."""
        outer = task.benchmark
        key = outer.dataset.name, fold
        if key not in self._benchmarks:
            protocol = protocol_for(self.tuning.objective, outer.protocol)
            gap = outer.folds.gap or Split().gap
            inner = Split(self.tuning.folds, "recordings", gap, self.tuning.seed)
            nested = training_benchmark(outer._replace(protocol=protocol), fold, inner)
            self._benchmarks[key] = nested
        return self._benchmarks[key]

    def call(
        self, study: Study, settings: Mapping[str, Any], tests: bool
    ) -> tuple[Task, PreparedBenchmark, Objective]:
        """Arguments of `score_trial`; held-out recordings are there for `tests` only."""
        task = study.task
        benchmark = self.benchmark(task, study.fold)
        key = task.benchmark.dataset.name, study.fold, task.recipe.name
        if key not in self._prepared:
            self._prepared[key] = prepare_benchmark(benchmark, [task.recipe])
        shared = self._prepared[key]
        if not tests:
            benchmark, shared = benchmark._replace(tests=()), shared._replace(tests=())
        return task.task(benchmark, settings), shared, self.tuning.objective


def tune(
    tasks: Sequence[TuningTask],
    tuning: Tuning,
    folder: Path,
    *,
    resume: bool = False,
    replace_trials: bool = False,
    jobs: int = 1,
    done: Callable[[str], None] = lambda _: None,
) -> list[Study]:
    """All studies of the tasks, when their searches have ended.

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
    data = NestedData(tuning)
    with readable_journal(folder):
        storage = open_journal(folder, resume=resume, replace=replace_trials)
        studies = [_study(storage, spec, data) for spec in study_specs(tasks, tuning)]
        for study in studies:
            for _ in study.trials[: tuning.trials]:
                done(study.name)
    while open_ := [study for study in studies if len(study.trials) < tuning.trials]:
        asked = [study.ask() for study in open_]
        pairs = zip(open_, asked, strict=True)
        calls = [data.call(study, settings, tests=False) for study, (_, settings) in pairs]
        for i, (value, _, error) in side_by_side(score_trial, calls, jobs):
            open_[i].tell(asked[i][0], value, error)
            done(open_[i].name)
    for study in studies:
        _ = study.best  # or there is nothing to choose
    nested = [s for s in studies if s.fold is not None and "held_out" not in s.record.user_attrs]
    _score_held_out(nested, data, jobs)
    return studies


def _study(storage: Any, spec: Spec, data: NestedData) -> Study:
    """The study of a spec, as the journal has it, or anew where data or settings differ."""
    task, sampler, fold = spec
    search, suite, seed = task.search, task.suite_settings, data.tuning.seed
    first = None
    if all(key in suite and space.holds(suite[key]) for key, space in search.items()):
        first = {k: suite[k] if s.choices is None else text_of(suite[k]) for k, s in search.items()}
    part = "all data" if fold is None else f"without fold {fold}"
    name, digest = f"{task.title}, {sampler}, {part}", _digest(spec, data)
    return Study(*spec, seed, open_study(storage, name, digest, first))


def _digest(spec: Spec, data: NestedData) -> str:
    """SHA-256 of all that a study depends on."""
    (task, sampler, fold), tuning = spec, data.tuning
    first = {key: space.ends[0] for key, space in task.search.items()}
    digest = task.task(data.benchmark(task, fold), first).digest
    spaces = {key: space.words for key, space in task.search.items()}
    words = json.dumps([spaces, task.suite_settings, tuning.objective.words, tuning.seed])
    return sha256(f"{digest} {words} {sampler}".encode())


def _score_held_out(studies: Sequence[Study], data: NestedData, jobs: int) -> None:
    """Score on each fold what was chosen without it, beside the suite's settings."""
    calls = [
        data.call(study, settings, tests=True)
        for study in studies
        for settings in (study.best.settings, {})
    ]
    scores: dict[int, float | None] = {}
    for i, (_, held_out, _) in side_by_side(score_trial, calls, jobs):
        scores[i] = held_out if math.isfinite(held_out) else None
        first = i - i % 2  # of the two calls of a study
        if first in scores and first + 1 in scores:
            both = {"chosen": scores[first], "suite": scores[first + 1]}
            studies[i // 2].record.set_user_attr("held_out", both)


# --- The suite with the settings that were chosen


def by_task(results: Sequence[Study]) -> list[list[Study]]:
    """Results grouped by what they tune."""
    return [list(group) for _, group in groupby(results, key=lambda r: r.task.title)]


def best_of(results: Sequence[Study]) -> Study:
    """Of the studies of one task on all data that of the lowest score, the first of equals."""
    return min((r for r in results if r.fold is None), key=lambda r: r.best.value)


def chosen_suite(file: Path, results: Sequence[Study], place: Path, objective: Objective) -> str:
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
    best = list(map(best_of, by_task(results)))
    document["identifiers"] = [
        entry for table in document["identifiers"] for entry in _chosen(table, best, file, place)
    ]
    head = [
        f"# Settings tuned on {name}: {objective.words}.",
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
    table: Mapping[str, Any], best: Sequence[Study], file: Path, place: Path
) -> list[dict[str, Any]]:
    """An identifier's table with the settings chosen, one for each recipe that tuned it."""
    entry = {key: value for key, value in table.items() if key != "search"}
    if entry["kind"] == "published" and "file" in entry:
        entry["file"] = _from(file.parent / entry["file"], place)
    name = entry.get("name", str(entry["kind"]).rpartition(":")[2])
    chosen = [result for result in best if result.task.name == name]
    if "search" not in table or not chosen:
        return [entry]
    tuned = [{**entry, **result.best.settings} for result in chosen]
    if len(tuned) > 1:
        for each, result in zip(tuned, chosen, strict=True):
            recipe = result.task.recipe.name
            each |= {"name": f"{name}-{recipe}", "recipes": [recipe]}
    return tuned


def _is(entry: Mapping[str, Any], file: Path, name: str) -> bool:
    """Whether an entry of a suite is the data set of a name."""
    from frictionid.files import dataset_path

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
