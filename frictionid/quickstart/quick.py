"""A first verdict in about a minute: check, a few laws on held-out motion, the one that predicts.

The rule is that of a comparison (`frictionid.evaluation.reference_model`), on fewer candidates:
the simplest law whose predictions are not practically worse than those of the best one. Laws are
fitted by shooting, with its defaults. Only folds count that hold out motion: in others all errors
are noise. With fewer than three of them the law of the smallest error counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from frictionid.arrays import Array
from frictionid.check import check
from frictionid.comparison.cross_validate import Benchmark, Result, prepare_benchmark, run
from frictionid.comparison.suite import identifier_named
from frictionid.comparison.suite_recipes import RecipeEntry, recipe_of
from frictionid.data.joint_scales import norm_of
from frictionid.data.readers.dataset import within
from frictionid.data.recordings import Dataset
from frictionid.dynamics.step_size import TooSteepError
from frictionid.errors import InputError
from frictionid.evaluation import Folds, Protocol, Split, make_folds
from frictionid.evaluation.complexity import nested_complexity
from frictionid.evaluation.prepared import usual_interval
from frictionid.evaluation.reference_model import StartErrors, choose, preferring
from frictionid.fitting.shooting.settings import torque_is_sampled
from frictionid.friction.provenance import Estimates

from .quick_report import Candidate, Quick

# by their number of parameters; `motor_load` where a motor's torque is sampled
LAWS = ("none", "coulomb_viscous", "motor_load", "stribeck", "spline")
STEPS = ("check", *LAWS)
_HORIZONS = (0.5, 0.25, 0.1)  # [s], the first one counts that the folds hold out
_FOLDS = 10
_FEWEST = 3  # recordings, below which stretches of time are held out
_ABOVE = 3.0  # times the angle noise: errors of folds that hold out motion
_SAMPLES = 6_000  # of all joints: so many are compared in a minute
_COARSEST = 0.01  # [s] between samples
_SHORTEST = 3.0  # [s] of a recording


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
    part, sample_time = shortened(dataset)
    horizon, results = _compared(part, sample_time, report)
    each = np.array([joint.angle_noise for joint in verdict.joints])
    noise = norm_of(each, dataset.mechanism.position_units, dataset.scales.size)[0]
    moving, candidates, chosen = candidates_of(results, part, horizon, float(noise))
    result = results[chosen.name]
    kept = () if chosen.refined is None else (e.block for e in chosen.refined.parameters)
    return Quick(
        check=verdict,
        seconds=sum(float(np.ptp(r.angle.time)) for r in part.recordings),
        horizon=horizon,
        free=tuple(dict.fromkeys(["friction", *kept])),
        folds=moving,
        candidates=candidates,
        chosen=chosen,
        friction=result.overall,
        refined=chosen.refined,
        velocity=result.grid,
    )


def _estimates(result: Result, dataset: Dataset) -> Estimates | None:
    """What the fit to all data estimated."""
    return None if result.refined is None else result.refined.estimates(dataset, result.grid)


def shortened(dataset: Dataset) -> tuple[Dataset, float | None]:
    """As much of a data set as is compared in a minute, and the time [s] between its samples.

    Fast samples are thinned first; then some recordings are taken, evenly spread; then the begin of
    each.
    """
    most = _SAMPLES / np.shape(dataset.recordings[0].angle.value)[1]
    spans = np.array([np.ptp(r.angle.time) for r in dataset.recordings])
    sample_time = time_between_samples(dataset, _SAMPLES)
    seconds = most * (sample_time or usual_interval(dataset))
    if spans.sum() <= seconds:
        return dataset, sample_time
    count = int(np.clip(seconds / spans.mean(), min(_FEWEST, len(spans)), len(spans)))
    chosen = np.unique(np.linspace(0, len(spans) - 1, count).round().astype(int))
    each = max(seconds / len(chosen), _SHORTEST)
    parts = tuple(within(dataset.recordings[i], 0.0, each) for i in chosen)
    return replace(dataset, recordings=parts), sample_time


def time_between_samples(dataset: Dataset, most: int) -> float | None:
    """Time [s] between samples that leaves so many of all joints, or 0.01; None: all of them."""
    usual, joints = usual_interval(dataset), np.shape(dataset.recordings[0].angle.value)[1]
    seconds = sum(float(np.ptp(r.angle.time)) for r in dataset.recordings)
    apart = max(usual, min(seconds * joints / most, _COARSEST))
    return apart if apart > 1.5 * usual else None


def laws_for(dataset: Dataset) -> tuple[str, ...]:
    """Names of the laws that are compared on a data set, from simple to rich."""
    driven = torque_is_sampled(dataset) or any(r.servo for r in dataset.recordings)
    return tuple(name for name in LAWS if driven or name != "motor_load")


def _compared(
    dataset: Dataset,
    sample_time: float | None,
    done: Callable[[str], None],
) -> tuple[float, dict[str, Result]]:
    """The longest horizon that the folds hold out, and the results of all laws."""
    recipe = recipe_of(RecipeEntry(name="shooting", by="shooting"))
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
    for name in laws_for(dataset):
        with suppress(TooSteepError):  # a law that no step can follow is no candidate
            results[name] = run(benchmark, identifier_named(name, {}), recipe, 0, shared)
        done(name)
    return horizon, results


def _folds(dataset: Dataset) -> Folds:
    several = len(dataset.recordings) >= _FEWEST
    count = min(len(dataset.recordings), _FOLDS) if several else _FOLDS
    split = Split(count=count, kind="recordings" if several else "blocks")
    return make_folds(dataset.recordings, split)


def candidates_of(
    results: Mapping[str, Result], dataset: Dataset, horizon: float, noise: float
) -> tuple[int, tuple[Candidate, ...], Candidate]:
    """Number of folds that hold out motion, the laws compared on these, and the chosen one."""
    folds = np.array([_by_fold(result, horizon) for result in results.values()])
    frictionless = np.array([result.overall.theta.size == 0 for result in results.values()])
    moving = np.flatnonzero(folds.max(axis=0) > _ABOVE * noise)
    errors = [_starts(result, horizon, moving) for result in results.values()]
    counts = [_complexity(result) for result in results.values()]
    names = [frozenset(result.overall.law.names) for result in results.values()]
    choice = choose(errors, nested_complexity(counts, names), frictionless=frictionless)
    refined = [_estimates(result, dataset) for result in results.values()]
    choice = preferring(choice, names, [e.shown if e else frozenset() for e in refined])
    candidates = tuple(
        Candidate(
            name=name,
            parameters=int(result.overall.theta.size),
            error=result.value("rollout_angle", "median", horizon),
            by_fold=by_fold,
            curves=result.curves,
            standing=choice.standings[i] if choice.standings else "",
            loss=choice.losses[i] if choice.losses else None,
            lacks=i in choice.lacking,
            refined=refined[i],
        )
        for i, ((name, result), by_fold) in enumerate(zip(results.items(), folds, strict=True))
    )
    laws = [c for c in candidates if c.parameters]
    smallest = min(laws, key=lambda c: c.error)
    chosen = smallest if choice.adequate is None else candidates[choice.adequate]
    return len(moving), candidates, chosen


def _starts(result: Result, horizon: float, moving: Array) -> StartErrors:
    """Errors of predictions that start in some of the folds."""
    assert result.errors is not None
    held_out = result.errors.held_out & np.isin(result.errors.fold, moving)
    return result.errors._replace(held_out=held_out).after(horizon)


def _complexity(result: Result) -> float:
    """Effective number of parameters, as in a comparison."""
    with suppress(InputError):
        return result.value("effective_parameters", "count")
    return float(result.overall.theta.size)


def _by_fold(result: Result, horizon: float) -> Array:
    """Median error after a horizon in each fold."""
    scores: Any = result.scores
    of_all = {"horizon_s": horizon, "score": "rollout_angle", "statistic": "median", "joint": "all"}
    for key, value in of_all.items():
        scores = scores[scores[key] == value]
    scores = scores[scores["fold"] != "all"].sort_values("fold")
    return np.asarray(scores["value"], dtype=float)
