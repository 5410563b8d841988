"""A first verdict in about a minute: check, three laws on held-out motion, the simplest that does.

The rule: of the laws that are not clearly worse than the best one after the horizon, the one with
the fewest parameters. A law is clearly worse where the 95 % interval (Student's t) of its error
relative to the other's, the geometric mean over the folds, lies above one. Only folds count that
hold out motion: in others all errors are noise. With fewer than three of them nothing is clear, and
the law of the smallest error counts. Laws are fitted by shooting, with the delay of a sampled
torque free, and inertia where the check says that it is off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as student

from frictionid.arrays import Array
from frictionid.check import Verdict, check
from frictionid.comparison.cross_validate import Benchmark, Result, prepare_benchmark, run
from frictionid.comparison.suite_identifiers import identifier_named
from frictionid.comparison.suite_recipes import RecipeEntry, recipe_of
from frictionid.data.joint_scales import norm_of
from frictionid.data.readers.dataset import within
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import Folds, Protocol, Split, make_folds
from frictionid.friction import Friction
from frictionid.shooting import document_of
from frictionid.shooting.default_blocks import torque_is_sampled

LAWS = ("none", "coulomb_viscous", "stribeck", "spline")  # by their number of parameters
STEPS = ("check", *LAWS)
_HORIZONS = (1.0, 0.5, 0.25, 0.1)  # [s], the first one counts that the folds hold out
_FOLDS = 5
_FEWEST = 3  # recordings, below which stretches of time are held out
FEWEST = 3  # folds with motion, below which a scatter says nothing
_ABOVE = 3.0  # times the angle noise: errors of folds that hold out motion
_SAMPLES = 6_000  # of all joints: so many are compared in a minute
_COARSEST = 0.01  # [s] between samples
_SHORTEST = 3.0  # [s] of a recording
# Blocks of shooting that are free beside friction, where the check has findings of these kinds.
_FREED = {"delay": "delay", "rotor": "inertia", "base": "inertia", "nominal_mechanism": "inertia"}


class Ratio(NamedTuple):
    """Error of one law over that of another, geometric mean over the folds, 95 % interval."""

    mean: float
    low: float
    high: float

    @property
    def is_clear(self) -> bool:
        """Whether the interval leaves out one, or is not known."""
        return not self.low <= 1.0 <= self.high


@dataclass(frozen=True)
class Candidate:
    """A law on held-out motion.

    error : median error after the horizon [rad], of all folds
    by_fold : (F,) the same in each fold
    to_best : relative to the law of the smallest error
    curves : (F + 1, V, n) [N m] friction of the folds and, last, of all data
    """

    name: str
    parameters: int
    error: float
    by_fold: Array
    to_best: Ratio
    curves: Array


@dataclass(frozen=True, eq=False)
class Quick:
    """A first verdict.

    Attributes
    ----------
    check : Verdict
    seconds : float [s] of motion that were compared, all where that takes no more than a minute
    horizon : float [s], after which errors are compared
    free : blocks of shooting that were free
    folds : number of folds that hold out motion
    candidates : tuple of Candidate, by their number of parameters; empty for unusable data
    chosen : Candidate or None, what the rule chooses
    friction : Friction or None, the chosen law fitted to all data
    refined : result document of that fit
    velocity : array, shape (V, n), at which curves stand
    """

    check: Verdict
    seconds: float = 0.0
    horizon: float = 0.0
    free: tuple[str, ...] = ("friction",)
    folds: int = 0
    candidates: tuple[Candidate, ...] = ()
    chosen: Candidate | None = None
    friction: Friction | None = None
    refined: Mapping[str, Any] = field(default_factory=dict)
    velocity: Array | None = None


def quick(dataset: Dataset, done: Callable[[str], None] | None = None) -> Quick:
    """A first verdict on a data set: are the data good, and which friction do they show.

    `done` is called with the name of each of `STEPS` that is finished.

    Raises
    ------
    InputError
        Where the recordings are too short to hold any motion out.

    Examples
    --------
    The verdict on recordings of one's own::

        print(quick(frictionid.load_dataset("my_rig")).chosen.name)
    """
    report = done or (lambda _: None)
    verdict = check(dataset)
    report(STEPS[0])
    if verdict.level == "unusable":
        return Quick(verdict)
    kinds = {finding.kind for finding in verdict.findings}
    usual = ["friction", "delay"] if torque_is_sampled(dataset) else ["friction"]
    asked = [b for kind, b in _FREED.items() if kind in kinds]
    free = tuple(dict.fromkeys([*usual, *asked]))
    part, sample_time = shortened(dataset)
    horizon, results = _compared(part, free, sample_time, report)
    each = np.array([joint.angle_noise for joint in verdict.joints])
    noise = norm_of(each, dataset.mechanism.position_units, dataset.scales.size)[0]
    moving, candidates = _candidates(results, horizon, float(noise))
    chosen = simplest(candidates)
    result = results[chosen.name]
    return Quick(
        check=verdict,
        seconds=sum(float(np.ptp(r.angle.time)) for r in part.recordings),
        horizon=horizon,
        free=free,
        folds=moving,
        candidates=candidates,
        chosen=chosen,
        friction=result.overall,
        refined=result.refined and document_of(result.refined, part, result.grid) or {},
        velocity=result.grid,
    )


def simplest(candidates: Sequence[Candidate]) -> Candidate:
    """The law with the fewest parameters that is not clearly worse than the best.

    No friction is never chosen: too little motion does not show that there is none.

    >>> best = Candidate("spline", 7, 0.1, np.ones(5), Ratio(1.0, 1.0, 1.0), np.zeros(1))
    >>> other = Candidate("stribeck", 4, 0.11, np.ones(5), Ratio(1.1, 0.9, 1.3), np.zeros(1))
    >>> simplest([other, best]).name
    'stribeck'
    """
    laws = [c for c in candidates if c.parameters]
    fair = [c for c in laws if not c.to_best.is_clear]
    return min(fair, key=lambda c: c.parameters) if fair else min(laws, key=lambda c: c.error)


def shortened(dataset: Dataset) -> tuple[Dataset, float | None]:
    """As much of a data set as is compared in a minute, and the time [s] between its samples.

    Fast samples are thinned first; then some recordings are taken, evenly spread; then the begin of
    each.
    """
    most = _SAMPLES / np.shape(dataset.recordings[0].angle.value)[1]
    usual = float(np.median(np.concatenate([np.diff(r.angle.time) for r in dataset.recordings])))
    spans = np.array([np.ptp(r.angle.time) for r in dataset.recordings])
    apart = max(usual, min(float(spans.sum()) / most, _COARSEST))
    sample_time = apart if apart > 1.5 * usual else None
    seconds = most * (sample_time or usual)
    if spans.sum() <= seconds:
        return dataset, sample_time
    count = int(np.clip(seconds / spans.mean(), min(_FEWEST, len(spans)), len(spans)))
    chosen = np.unique(np.linspace(0, len(spans) - 1, count).round().astype(int))
    each = max(seconds / len(chosen), _SHORTEST)
    parts = tuple(within(dataset.recordings[i], 0.0, each) for i in chosen)
    return replace(dataset, recordings=parts), sample_time


def _compared(
    dataset: Dataset,
    free: Sequence[str],
    sample_time: float | None,
    done: Callable[[str], None],
) -> tuple[float, dict[str, Result]]:
    """The longest horizon that the folds hold out, and the results of all laws."""
    recipe = recipe_of(RecipeEntry(name="shooting", by="shooting", free=list(free)))
    folds = _folds(dataset)
    for horizon in _HORIZONS:
        protocol = Protocol(horizons=(horizon,), sample_time=sample_time)
        benchmark = Benchmark(dataset, folds, protocol)
        try:
            shared = prepare_benchmark(benchmark, [recipe])
            break
        except InputError:  # no fold holds out so much motion
            if horizon == _HORIZONS[-1]:
                raise
    results = {}
    for name in LAWS:
        results[name] = run(benchmark, identifier_named(name, {}), recipe, 0, shared)
        done(name)
    return horizon, results


def _folds(dataset: Dataset) -> Folds:
    several = len(dataset.recordings) >= _FEWEST
    count = min(len(dataset.recordings), _FOLDS) if several else _FOLDS
    split = Split(count=count, kind="recordings" if several else "blocks")
    return make_folds(dataset.recordings, split)


def _candidates(
    results: Mapping[str, Result], horizon: float, noise: float
) -> tuple[int, tuple[Candidate, ...]]:
    """Number of folds that hold out motion, and the laws compared on these."""
    errors = {n: r.value("rollout_angle", "median", horizon) for n, r in results.items()}
    folds = {name: _by_fold(result, horizon) for name, result in results.items()}
    best = min(errors, key=lambda name: errors[name])
    moving = np.max(list(folds.values()), axis=0) > _ABOVE * noise
    return int(moving.sum()), tuple(
        Candidate(
            name=name,
            parameters=result.overall.theta.size,
            error=errors[name],
            by_fold=folds[name],
            to_best=_ratio(folds[name][moving], folds[best][moving]),
            curves=result.curves,
        )
        for name, result in results.items()
    )


def _by_fold(result: Result, horizon: float) -> Array:
    """Median error after a horizon in each fold."""
    own: Any = result.scores
    own = own[own["horizon_s"] == horizon]
    for key, value in {"score": "rollout_angle", "statistic": "median", "joint": "all"}.items():
        own = own[own[key] == value]
    own = own[own["fold"] != "all"].sort_values("fold")
    return np.asarray(own["value"], dtype=float)


def _ratio(mine: Array, theirs: Array) -> Ratio:
    """Ratio of errors (F,); its interval is empty where too few folds tell of it."""
    if len(mine) < FEWEST:
        return Ratio(float("nan"), float("nan"), float("nan"))
    logs = np.log(mine / theirs)
    half = student.ppf(0.975, len(logs) - 1) * np.std(logs, ddof=1) / np.sqrt(len(logs))
    mean = float(np.mean(logs))
    return Ratio(*(float(np.exp(v)) for v in (mean, mean - half, mean + half)))
