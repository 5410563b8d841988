"""Searches for settings: one Optuna study for each unit, sampler and fold [Akiba2019].

All trials stand in one journal on disk, written as they finish: a search that was interrupted goes
on from there, and finds what it would have found. Samplers: tree-structured Parzen estimators
("tpe") [Bergstra2011], Gaussian processes ("gp") and, as the baseline, "random".
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.comparison.cross_validate import Benchmark, PreparedBenchmark, prepare_benchmark
from frictionid.comparison.search_space import Space, Tuning, text_of
from frictionid.comparison.tasks import side_by_side
from frictionid.comparison.tuning.nested_folds import training_benchmark
from frictionid.comparison.tuning.trial import Judged, TuningTask, judged, protocol_for
from frictionid.errors import InputError
from frictionid.evaluation import Split

JOURNAL = "journal.log"
AT_RANDOM = 5  # trials before a sampler follows what it has seen


class Trial(NamedTuple):
    """One trial of a study: settings, score on inner folds (NaN if none was found), and why not."""

    settings: Mapping[str, Any]
    value: float
    error: str


class Found(NamedTuple):
    """What a study found; `fold` is the outer fold it is nested in, None for all data.

    own : score of the suite's own settings on the inner folds, NaN where they are none of the space
    held_out, held_out_own : scores of the chosen and of the suite's settings on the held-out fold
    """

    unit: TuningTask
    sampler: str
    fold: int | None
    trials: tuple[Trial, ...]
    own: float
    held_out: float
    held_out_own: float

    @property
    def best(self) -> Trial:
        """The trial of the lowest score, the first of equals."""
        return min(self.trials, key=lambda t: math.inf if math.isnan(t.value) else t.value)


class StudySpec(NamedTuple):
    """A study to be made: a unit with a sampler, nested in a fold or on all data."""

    unit: TuningTask
    sampler: str
    fold: int | None

    @property
    def name(self) -> str:
        """Name of the study in the journal."""
        part = "all data" if self.fold is None else f"without fold {self.fold}"
        return f"{self.unit.title}, {self.sampler}, {part}"


class Studies:
    """The studies of some units in a folder's journal."""

    def __init__(
        self, units: Sequence[TuningTask], tuning: Tuning, folder: Path, resume: bool
    ) -> None:
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self.tuning = tuning
        self.specs = study_specs(units, tuning)
        self._contests: dict[tuple[str, int | None], Benchmark] = {}
        self._grounds: dict[tuple[str, int | None, str], PreparedBenchmark] = {}
        path = folder / JOURNAL
        if not resume:
            path.unlink(missing_ok=True)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.storage = JournalStorage(JournalFileBackend(str(path)))
        except OSError as error:
            raise InputError(
                f"{folder}: cannot be written ({error.strerror}): choose another --out"
            ) from None
        except (ValueError, KeyError):
            raise InputError(f"{path}: is no journal: tune anew without --resume") from None
        self.studies = [self._study(spec) for spec in self.specs]

    def benchmark(self, unit: TuningTask, fold: int | None) -> Benchmark:
        """What a study may see of a unit's data."""
        key = unit.benchmark.dataset.name, fold
        if key not in self._contests:
            protocol = protocol_for(self.tuning.objective, unit.benchmark.protocol)
            whole = replace(unit.benchmark, protocol=protocol)
            gap = unit.benchmark.folds.gap or Split().gap
            inner = Split(self.tuning.folds, "recordings", gap, self.tuning.seed)
            self._contests[key] = training_benchmark(whole, fold, inner)
        return self._contests[key]

    def shared(self, unit: TuningTask, fold: int | None) -> PreparedBenchmark:
        """What all trials of a unit share."""
        key = unit.benchmark.dataset.name, fold, unit.recipe.name
        if key not in self._grounds:
            self._grounds[key] = prepare_benchmark(self.benchmark(unit, fold), [unit.recipe])
        return self._grounds[key]

    def _study(self, spec: StudySpec) -> Any:
        """The study of a spec, as the journal has it, or anew where data or settings differ."""
        import optuna

        digest = self._digest(spec)
        names = optuna.get_all_study_names(self.storage)
        if spec.name in names:
            study = optuna.load_study(study_name=spec.name, storage=self.storage)
            if study.user_attrs.get("digest") == digest:
                _forget_unfinished(study)
                return study
            optuna.delete_study(study_name=spec.name, storage=self.storage)
        study = optuna.create_study(study_name=spec.name, storage=self.storage)
        study.set_user_attr("digest", digest)
        own = spec.unit.own
        if all(k in own and space.holds(own[k]) for k, space in spec.unit.search.items()):
            study.enqueue_trial(_told(spec.unit.search, own), user_attrs={"own": True})
        return study

    def _digest(self, spec: StudySpec) -> str:
        """SHA-256 of all that a study depends on."""
        plain = {key: space.ends[0] for key, space in spec.unit.search.items()}
        task = spec.unit.task(self.benchmark(spec.unit, spec.fold), plain)
        spaces = {key: space.words for key, space in spec.unit.search.items()}
        words = json.dumps([spaces, spec.unit.own, self.tuning.objective.words, self.tuning.seed])
        return hashlib.sha256(f"{task.digest} {words} {spec.sampler}".encode()).hexdigest()

    def asked(self, place: int) -> tuple[Any, dict[str, Any]]:
        """The next trial of a study, and its settings."""
        spec, study = self.specs[place], self.studies[place]
        # anew for each trial: what it proposes does not depend on interruptions
        study.sampler = _sampler(spec.sampler, _seed(self.tuning.seed, len(_finished(study))))
        trial = study.ask(_distributions(spec.unit.search))
        return trial, _settings(spec.unit.search, trial.params)

    def finish(self, place: int, trial: Any, found: Judged) -> None:
        """Write a trial's score, or why it has none."""
        if math.isfinite(found.value):
            self.studies[place].tell(trial, found.value)
            return
        trial.set_user_attr("error", found.error or f"its score is {found.value}")
        self.studies[place].tell(trial, state=_states().FAIL)

    def found(self, place: int) -> Found:
        """What a study has found so far."""
        spec, study = self.specs[place], self.studies[place]
        trials, own = [], math.nan
        for t in _finished(study):
            value = math.nan if t.value is None else float(t.value)
            settings = _settings(spec.unit.search, t.params)
            trials.append(Trial(settings, value, str(t.user_attrs.get("error", ""))))
            own = value if t.user_attrs.get("own") else own
        if all(math.isnan(t.value) for t in trials):
            reason = trials[0].error if trials else "it has no trials"
            raise InputError(f"{spec.name}: no trial has a score: {reason}")
        held = study.user_attrs.get("held_out") or {}
        scores = [math.nan if held.get(k) is None else held[k] for k in ("chosen", "own")]
        return Found(spec.unit, spec.sampler, spec.fold, tuple(trials), own, *scores)


def tune(
    units: Sequence[TuningTask],
    tuning: Tuning,
    folder: Path,
    *,
    resume: bool = False,
    jobs: int = 1,
    done: Callable[[str], None] | None = None,
) -> list[Found]:
    """What all studies find; `done` is called with the name of the study of each finished trial.

    Raises
    ------
    InputError
        Where folds, data and settings do not fit together, or no trial of a study has a score.
    """
    studies, tell = Studies(units, tuning, folder, resume), done or (lambda _: None)
    for place, study in enumerate(studies.studies):
        for _ in range(min(len(_finished(study)), tuning.trials)):
            tell(studies.specs[place].name)
    while places := [p for p, s in enumerate(studies.studies) if _left(s, tuning)]:
        asked = [studies.asked(place) for place in places]
        calls = [
            _call(studies, place, settings, tests=False)
            for place, (_, settings) in zip(places, asked, strict=True)
        ]
        for i, found in side_by_side(judged, calls, jobs):
            studies.finish(places[i], asked[i][0], found)
            tell(studies.specs[places[i]].name)
    _hold_out(studies, jobs)
    return [studies.found(place) for place in range(len(studies.specs))]


def _hold_out(studies: Studies, jobs: int) -> None:
    """Score, on each fold, what was chosen without it, beside the suite's own settings."""
    wanted: list[tuple[int, str, dict[str, Any]]] = []
    for place, spec in enumerate(studies.specs):
        if spec.fold is None or "held_out" in studies.studies[place].user_attrs:
            continue
        wanted.append((place, "chosen", dict(studies.found(place).best.settings)))
        wanted.append((place, "own", {}))
    calls = [_call(studies, place, settings, tests=True) for place, _, settings in wanted]
    scores: dict[int, dict[str, float | None]] = {}
    for i, found in side_by_side(judged, calls, jobs):
        place, which, _ = wanted[i]
        own = scores.setdefault(place, {})
        own[which] = found.held_out if math.isfinite(found.held_out) else None
        if len(own) == 2:
            studies.studies[place].set_user_attr("held_out", own)


def _call(
    studies: Studies, place: int, settings: Mapping[str, Any], tests: bool
) -> tuple[Any, ...]:
    """Arguments of `judged`; recordings held out from tuning are there for `tests` only."""
    spec = studies.specs[place]
    benchmark, shared = (
        studies.benchmark(spec.unit, spec.fold),
        studies.shared(spec.unit, spec.fold),
    )
    if not tests:
        benchmark, shared = replace(benchmark, tests=()), shared._replace(tests=())
    return spec.unit.task(benchmark, settings), shared, studies.tuning.objective


def study_specs(units: Sequence[TuningTask], tuning: Tuning) -> list[StudySpec]:
    """Studies to be made: of each unit with each sampler, on all data and, nested, in each fold."""
    return [
        StudySpec(unit, sampler, fold)
        for unit in units
        for sampler in tuning.samplers
        for fold in (None, *(range(unit.benchmark.folds.count) if tuning.nested else ()))
    ]


def _states() -> Any:
    from optuna.trial import TrialState

    return TrialState


def _finished(study: Any) -> list[Any]:
    """Trials that have a score, or were found to have none; not those that were interrupted."""
    states = _states()
    trials = study.get_trials(deepcopy=False, states=(states.COMPLETE, states.FAIL))
    return [t for t in trials if not t.user_attrs.get("interrupted")]


def _left(study: Any, tuning: Tuning) -> int:
    return max(tuning.trials - len(_finished(study)), 0)


def _forget_unfinished(study: Any) -> None:
    """Set aside the trials that ran when a search was interrupted, and queue the suite's own."""
    states = _states()
    for trial in study.get_trials(deepcopy=False, states=(states.RUNNING,)):
        study._storage.set_trial_user_attr(trial._trial_id, "interrupted", True)
        study.tell(trial.number, state=states.FAIL)
        if trial.user_attrs.get("own"):
            study.enqueue_trial(trial.params, user_attrs={"own": True})


def _seed(seed: int, trial: int) -> int:
    """Seed of a trial; those of neighbours have nothing in common."""
    return int.from_bytes(hashlib.sha256(f"{seed} {trial}".encode()).digest()[:4], "big")


def _sampler(name: str, seed: int) -> Any:
    import warnings

    from optuna import samplers

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one of them is called experimental
        if name == "gp":
            return samplers.GPSampler(seed=seed, n_startup_trials=AT_RANDOM)
        if name == "tpe":
            return samplers.TPESampler(seed=seed, n_startup_trials=AT_RANDOM)
        return samplers.RandomSampler(seed)


def _distributions(search: Mapping[str, Space]) -> dict[str, Any]:
    from optuna.distributions import (
        CategoricalDistribution,
        FloatDistribution,
        IntDistribution,
    )

    out: dict[str, Any] = {}
    for key, space in search.items():
        if space.choices is not None:
            out[key] = CategoricalDistribution([text_of(choice) for choice in space.choices])
        elif space.whole:
            step = int(space.step) or 1
            out[key] = IntDistribution(int(space.low), int(space.high), space.log, step)
        else:
            step_ = float(space.step) or None
            out[key] = FloatDistribution(float(space.low), float(space.high), space.log, step_)
    return out


def _told(search: Mapping[str, Space], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as a study has them: choices by their text."""
    return {
        key: settings[key] if space.choices is None else text_of(settings[key])
        for key, space in search.items()
    }


def _settings(search: Mapping[str, Space], params: Mapping[str, Any]) -> dict[str, Any]:
    """A study's parameters as settings, in the order of the search."""
    out = {}
    for key, space in search.items():
        if space.choices is None:
            out[key] = params[key]
        else:
            known = {text_of(choice): choice for choice in space.choices}
            out[key] = known[params[key]]
    return out
