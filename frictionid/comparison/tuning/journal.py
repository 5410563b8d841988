"""Optuna studies in a journal on disk [Akiba2019], written trial by trial.

A search that was interrupted goes on from there, and gives what it would have given. Samplers:
tree-structured Parzen estimators ("tpe") [Bergstra2011], Gaussian processes ("gp") and, as the
baseline, "random".
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.comparison.search_space import Space, text_of
from frictionid.errors import InputError, needs
from frictionid.files import read_bytes, write_bytes

JOURNAL = "journal.log"
_LARGEST = 1e20  # of a score
AT_RANDOM = 5  # trials before a sampler follows earlier ones


class Trial(NamedTuple):
    """One trial of a study.

    value : score on the inner folds, NaN if the fit failed; error : why it failed
    of_suite : whether the settings are those of the suite
    """

    settings: Mapping[str, Any]
    value: float
    error: str = ""
    of_suite: bool = False


@dataclass(frozen=True, eq=False)
class Study:
    """A study of the journal, over a search space by a sampler."""

    optuna_study: Any
    search: Mapping[str, Space]
    sampler: str
    seed: int

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Finished trials in their order, without those that were interrupted."""
        out = []
        for t in self._finished():
            value = math.nan if t.value is None else float(t.value)
            if abs(value) >= _LARGEST:
                raise ValueError(f"no trial has the score {value}")
            error = str(t.user_attrs.get("error", ""))
            of_suite = bool(t.user_attrs.get("suite"))
            out.append(Trial(self._settings(t.params), value, error, of_suite))
        return tuple(out)

    def ask(self) -> tuple[Any, dict[str, Any]]:
        """The next trial, and its settings."""
        # anew for each trial: what it proposes does not depend on interruptions
        number = len(self._finished())
        self.optuna_study.sampler = _sampler(self.sampler, _trial_seed(self.seed, number))
        trial = self.optuna_study.ask({k: _distribution(s) for k, s in self.search.items()})
        return trial, self._settings(trial.params)

    def tell(self, trial: Any, value: float, error: str) -> None:
        """Write a trial's score or, where it has none, why."""
        if abs(value) < _LARGEST:
            self.optuna_study.tell(trial, value)
            return
        trial.set_user_attr("error", error or f"its score is {value}")
        self.optuna_study.tell(trial, state=_states().FAIL)

    @property
    def held_out(self) -> Mapping[str, float | None] | None:
        """Scores on the held-out fold, of the "chosen" and the "suite" settings."""
        return self.optuna_study.user_attrs.get("held_out")

    def set_held_out(self, scores: Mapping[str, float | None]) -> None:
        """Write the scores on the held-out fold."""
        self.optuna_study.set_user_attr("held_out", dict(scores))

    def _finished(self) -> list[Any]:
        """Trials that have a score or failed, but for those that were interrupted."""
        states = (_states().COMPLETE, _states().FAIL)
        trials = self.optuna_study.get_trials(deepcopy=False, states=states)
        return [t for t in trials if not t.user_attrs.get("interrupted")]

    def _settings(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Parameters of Optuna as settings: choices are stored as texts."""
        out = {}
        for key, space in self.search.items():
            choices = {text_of(choice): choice for choice in space.choices or ()}
            out[key] = choices[params[key]] if choices else params[key]
        return out


def open_journal(folder: Path, *, resume: bool = False, replace: bool = False) -> Any:
    """Optuna's storage in the folder, empty unless it is to be resumed.

    Raises
    ------
    InputError
        Where it cannot be written, is no journal, or has trials that are neither to be kept nor to
        be replaced.
    """
    with needs("tuning"):
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    path = folder / JOURNAL
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if replace and not resume:
            path.unlink(missing_ok=True)
        elif path.exists():
            _drop_half_line(path)
        storage = JournalStorage(JournalFileBackend(str(path)))
        names = optuna.get_all_study_names(storage)
        if not resume and any(
            optuna.load_study(study_name=name, storage=storage).trials for name in names
        ):
            raise InputError(
                f"{path}: holds trials: go on with --resume, or begin anew with --replace"
            )
        return storage
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}): choose another --out"
        ) from None


def _drop_half_line(path: Path) -> None:
    """Remove the half line that a killed search left at the end: the next one would follow in it.

    Raises
    ------
    InputError
        Where another line is none of a journal.
    """
    content = read_bytes(path)
    whole = content[: content.rfind(b"\n") + 1]
    try:
        for line in whole.splitlines():
            json.loads(line)
    except (ValueError, RecursionError):
        raise InputError(f"{path}: is no journal: tune anew with --replace") from None
    if whole != content:
        write_bytes(path, whole)


@contextmanager
def readable_journal(folder: Path) -> Iterator[None]:
    """Whatever Optuna lets through of wrong lines of the journal becomes one line.

    Raises
    ------
    InputError
        With the way out.
    """
    try:
        yield
    except (InputError, OSError):
        raise
    except Exception:
        raise InputError(f"{folder / JOURNAL}: is no journal: tune anew with --replace") from None


def open_study(storage: Any, name: str, digest: str, first: Mapping[str, Any] | None) -> Any:
    """Optuna's study of a name and digest, a new one where there is none; those of others stay.

    first : parameters of the first trial, where the space holds the suite's settings
    """
    import optuna

    name = f"{name} [{digest}]"
    is_new = name not in optuna.get_all_study_names(storage)
    study = optuna.create_study(study_name=name, storage=storage, load_if_exists=True)
    if not is_new:
        _set_unfinished_aside(study)
    elif first is not None:
        study.enqueue_trial(dict(first), user_attrs={"suite": True})
    return study


def as_params(search: Mapping[str, Space], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as parameters of Optuna: choices by their text."""
    return {
        key: settings[key] if space.choices is None else text_of(settings[key])
        for key, space in search.items()
    }


def _set_unfinished_aside(study: Any) -> None:
    """Mark the trials that ran when a search was interrupted, and queue the suite's again."""
    states = _states()
    for trial in study.get_trials(deepcopy=False, states=(states.RUNNING,)):
        study._storage.set_trial_user_attr(trial._trial_id, "interrupted", True)
        study.tell(trial.number, state=states.FAIL)
        if trial.user_attrs.get("suite"):
            study.enqueue_trial(trial.params, user_attrs={"suite": True})


def _states() -> Any:
    from optuna.trial import TrialState

    return TrialState


def _trial_seed(seed: int, trial: int) -> int:
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


def _distribution(space: Space) -> Any:
    from optuna import distributions

    if space.choices is not None:
        return distributions.CategoricalDistribution([text_of(c) for c in space.choices])
    if space.whole:
        low, high, step = int(space.low), int(space.high), int(space.step) or 1
        return distributions.IntDistribution(low, high, space.log, step)
    low_, high_, step_ = float(space.low), float(space.high), float(space.step) or None
    return distributions.FloatDistribution(low_, high_, space.log, step_)
