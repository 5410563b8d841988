"""Optuna studies in a journal on disk [Akiba2019], written trial by trial.

A search that was interrupted goes on from there, and gives what it would have given. Samplers:
tree-structured Parzen estimators ("tpe") [Bergstra2011], Gaussian processes ("gp") and, as the
baseline, "random".
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.errors import InputError, needs
from frictionid.files import read_bytes, write_bytes

from ..search_space import Space, text_of

JOURNAL = "journal.log"
LARGEST = 1e20  # of a score
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


def _set_unfinished_aside(study: Any) -> None:
    """Mark the trials that ran when a search was interrupted, and queue the suite's again."""
    from optuna.trial import TrialState

    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        study._storage.set_trial_user_attr(trial._trial_id, "interrupted", True)
        study.tell(trial.number, state=TrialState.FAIL)
        if trial.user_attrs.get("suite"):
            study.enqueue_trial(trial.params, user_attrs={"suite": True})


def sampler_of(name: str, seed: int, trial: int) -> Any:
    """Sampler of one trial; seeds of neighbours have nothing in common."""
    import warnings

    from optuna import samplers

    digest = hashlib.sha256(f"{seed} {trial}".encode()).digest()
    seed = int.from_bytes(digest[:4], "big")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one of them is called experimental
        if name == "gp":
            return samplers.GPSampler(seed=seed, n_startup_trials=AT_RANDOM)
        if name == "tpe":
            return samplers.TPESampler(seed=seed, n_startup_trials=AT_RANDOM)
        return samplers.RandomSampler(seed)


def distribution_of(space: Space) -> Any:
    """Optuna's distribution of a space: choices by their texts."""
    from optuna import distributions

    if space.choices is not None:
        return distributions.CategoricalDistribution([text_of(c) for c in space.choices])
    if space.whole:
        low, high, step = int(space.low), int(space.high), int(space.step) or 1
        return distributions.IntDistribution(low, high, space.log, step)
    low_, high_, step_ = float(space.low), float(space.high), float(space.step) or None
    return distributions.FloatDistribution(low_, high_, space.log, step_)
