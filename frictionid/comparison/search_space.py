"""What tuning searches: ranges and choices of settings, how many trials, by which sampler.

Trials are those of Optuna, in a journal on disk [Akiba2019]: a search that was interrupted goes on
from there, and gives what it would have given. Samplers: tree-structured Parzen estimators ("tpe")
[Bergstra2011], Gaussian processes ("gp") and, as the baseline, "random".
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from frictionid.config import NonEmpty, Strict
from frictionid.errors import InputError, needs
from frictionid.files import read_bytes, write_bytes

Sampler = Literal["tpe", "gp", "random"]


def _number(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"it should be a number, not {value!r}")
    return value


Number = Annotated[int | float, BeforeValidator(_number)]


class Space(Strict):
    """Values that a setting may take: a range from `low` to `high`, or some `choices`.

    A range of two whole numbers has whole numbers only, on request in steps; `log` spreads the
    values evenly over their logarithm.

    >>> Space(low=1e-4, high=1e-2, log=True).words
    '0.0001 to 0.01, log'
    """

    low: Number = 0
    high: Number = 0
    log: bool = False
    step: Number = 0
    choices: NonEmpty[Any] | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> "Space":
        low, high, keys = self.low, self.high, self.model_fields_set
        if self.choices is not None:
            if keys != {"choices"}:
                raise ValueError("choices stand alone: no low, high, log, step beside them")
            texts = [text_of(choice) for choice in self.choices]
            if len(set(texts)) < len(texts):
                raise ValueError(f"choices must differ, they are {self.choices}")
            return self
        if not keys >= {"low", "high"}:
            raise ValueError("needs low and high, or choices")
        if not low < high:
            raise ValueError(f"low = {low} must be below high = {high}")
        if self.step < 0 or ("step" in keys and self.step == 0):
            raise ValueError(f"step = {self.step} must be positive")
        if self.log and (low <= 0 or self.step):
            raise ValueError("log needs a positive low, and no step")
        if self.whole and isinstance(self.step, float):
            raise ValueError(f"step = {self.step} of whole numbers must be a whole number")
        return self

    @property
    def whole(self) -> bool:
        """Whether the range has whole numbers only."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    @property
    def ends(self) -> list[Any]:
        """Values to try whether a setting takes them: all choices, or both ends of the range."""
        return list(self.choices) if self.choices is not None else [self.low, self.high]

    @property
    def words(self) -> str:
        """The space as a table tells it."""
        if self.choices is not None:
            return " | ".join(map(text_of, self.choices))
        step = f", step {self.step:g}" if self.step else ""
        return f"{self.low:g} to {self.high:g}{step}{', log' if self.log else ''}"

    def holds(self, value: Any) -> bool:
        """Whether a value is one of the space."""
        if self.choices is not None:
            return text_of(value) in map(text_of, self.choices)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return False
        if not self.low <= value <= self.high or (self.whole and isinstance(value, float)):
            return False
        return not self.step or (value - self.low) % self.step == 0


Search = Annotated[Mapping[str, Space], Field(min_length=1)]


class Objective(Strict):
    """Score that tuning lowers, on held-out parts of what it may see."""

    score: Literal["rollout_angle", "one_step_euler", "one_step_integral"] = "one_step_integral"
    statistic: Literal["mean", "rms", "median", "q90"] | None = None
    horizon: Annotated[float, Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _of_a_score(self) -> "Objective":
        rollout = self.score == "rollout_angle"
        if rollout and self.horizon is None:
            raise ValueError("rollout_angle needs a horizon [s], e.g. horizon = 0.5")
        if rollout and self.statistic in ("mean", "rms"):
            raise ValueError(f"rollout_angle has no {self.statistic}: choose median or q90")
        if not rollout and self.horizon is not None:
            raise ValueError(f"horizon belongs to rollout_angle, not to {self.score}")
        return self

    @property
    def key(self) -> tuple[str, str, float | None]:
        """Score, statistic and horizon [s] as results have them."""
        usual = {"rollout_angle": "median", "one_step_euler": "mean", "one_step_integral": "rms"}
        return self.score, self.statistic or usual[self.score], self.horizon

    @property
    def words(self) -> str:
        """The objective as a sentence names it."""
        score, statistic, horizon = self.key
        if horizon is not None:
            return (
                f"{'median' if statistic == 'median' else '90 %'} angle error after {horizon:g} s"
            )
        return f"{score.removeprefix('one_step_')} one-step loss, {statistic}"


class Tuning(Strict):
    """How settings are searched.

    trials : of each study; samplers : one study for each; folds : inner ones; nested : whether each
    outer fold is tuned for itself, without its held-out recordings, beside the tuning on all data
    """

    trials: Annotated[int, Field(ge=1)] = 30
    samplers: NonEmpty[Sampler] = ["tpe"]
    folds: Annotated[int, Field(ge=2)] = 3
    objective: Objective = Objective()
    seed: Annotated[int, Field(ge=0)] = 0
    nested: bool = True

    @model_validator(mode="after")
    def _each_once(self) -> "Tuning":
        if len(set(self.samplers)) < len(self.samplers):
            raise ValueError(f"samplers must differ, they are {self.samplers}")
        return self


def text_of(value: Any) -> str:
    """A choice as text, the same for equal choices: TOML's own way for what is no table.

    >>> text_of([16, 16]), text_of("tanh"), text_of(True)
    ('[16, 16]', 'tanh', 'true')
    """
    return value if isinstance(value, str) else json.dumps(value)


# --- Optuna's studies in a journal on disk --------------------------------------------------------


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
    """Whatever Optuna lets through of wrong lines of the journal becomes one line."""
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
