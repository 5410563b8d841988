"""The comparison: every identifier by every recipe on identical folds.

What `run` does for one identifier and one recipe is a task: its folds are fitted together, the
friction of all data with them, and each is judged on what it was not fitted to.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.comparison.equations import equations
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import (
    CalibratedView,
    Folds,
    Prepared,
    Protocol,
    calibrated_views,
    curves,
    initial_state_folds,
    member_curves,
    prepare,
    prepared_for,
    score_folds,
    score_model,
    score_value,
    training_of,
    trajectory_folds,
    without_physics,
)
from frictionid.evaluation.hysteresis import HysteresisLoop, HysteresisSettings, hysteresis_loops
from frictionid.friction import Friction
from frictionid.identifiers import Identifier
from frictionid.identifiers.formulation import INTEGRAL, Recipe
from frictionid.identifiers.residual import Problem
from frictionid.mechanics import Plant, plant_of, unit_inertia_plant
from frictionid.mechanics.calibration import Calibration
from frictionid.shooting import CalibratedRecipe, Refined, Shooting, refine_folds
from frictionid.shooting.calibrated_recipe import (
    PARTS,
    calibrations_of,
    part_of_calibration,
)
from frictionid.shooting.intervals import Intervals, intervals_of

Method = Recipe | Shooting | CalibratedRecipe


class Result(NamedTuple):
    """What a task found: scores, friction of the folds and of all data, pictures' data.

    `scores`, and `tests` by the names of the data sets, are score frames. `curves` stand at the
    velocities (V, n) of `grid`; `refined` is what shooting knows of the friction of all data.
    `loops` are of the folds and of all data. `members` (N, V, n) are curves of the N members of an
    ensemble of all data, none where it is no ensemble.
    """

    scores: pd.DataFrame
    friction: Friction
    overall: Friction
    curves: Array
    motions: tuple[dict[str, Any], ...]
    tests: Mapping[str, pd.DataFrame]
    seconds: Mapping[str, float]
    grid: Array
    refined: Refined | None = None
    loops: tuple[HysteresisLoop, ...] = ()
    members: Array | None = None

    def value(
        self, score: str, statistic: str, horizon: float | None = None, joint: str = "all"
    ) -> float:
        """One held-out score, pooled over the folds.

        Raises
        ------
        InputError
            Where there is no such score.
        """
        return score_value(self.scores, score, statistic, horizon, joint)


@dataclass(frozen=True, eq=False)
class Benchmark:
    """A data set with its folds, and data sets that only test what was fitted to it."""

    dataset: Dataset
    folds: Folds
    protocol: Protocol = field(default_factory=Protocol)
    tests: tuple[Dataset, ...] = ()


class PreparedBenchmark(NamedTuple):
    """What all identifiers of a benchmark share, made once: see `prepare_benchmark`."""

    prepared: Prepared
    tests: tuple[Prepared, ...]
    problems: Mapping[str, Problem]  # what each recipe fits, by its name
    weights: Mapping[str, Array]  # (F + 1, K): the rows that train each fold, and all rows
    intervals: Intervals | None = (
        None  # what shooting fits, and the intervals (F + 1, K) of each fold
    )
    training: Array | None = None
    calibrations: Mapping[
        str, Calibration
    ] = {}  # of all folds and all data, by the name of the recipe they serve
    views: Mapping[str, tuple[CalibratedView, ...]] = {}  # the data as these calibrations see them


def prepare_benchmark(benchmark: Benchmark, recipes: Sequence[Method]) -> PreparedBenchmark:
    """States, problems, training rows and rollout starts of a benchmark.

    Raises
    ------
    InputError
        Where recordings, folds and protocol do not fit together.
    """
    prepared = prepare(benchmark.dataset, benchmark.protocol)
    initial_state_folds(prepared.initial_states, benchmark.folds, prepared.causal)
    if prepared.trajectory is not None:
        trajectory_folds(prepared.trajectory, benchmark.folds)
    begins = [r.by.start for r in recipes if isinstance(r, CalibratedRecipe)]
    steps = {recipe.name: recipe for recipe in (*map(first_step, recipes), *begins)}
    problems = {name: training_of(prepared, recipe) for name, recipe in steps.items()}
    weights = {name: _weights(benchmark, problem) for name, problem in problems.items()}
    tests = tuple(prepare(test, benchmark.protocol) for test in benchmark.tests)
    if not any(isinstance(recipe, Shooting | CalibratedRecipe) for recipe in recipes):
        return PreparedBenchmark(prepared, tests, problems, weights)
    intervals = intervals_of(prepared.dataset, states=prepared.smoothed)
    training = benchmark.folds.training(intervals.recording, intervals.time, intervals.dt)
    training = np.concatenate([training, np.ones((1, len(intervals.dt)))])
    shared = PreparedBenchmark(prepared, tests, problems, weights, intervals, training)
    calibrations = _calibrations(benchmark, shared, recipes)
    views = {
        name: calibrated_views(prepared, calibration, len(training))
        for name, calibration in calibrations.items()
    }
    return shared._replace(calibrations=calibrations, views=views)


def first_step(recipe: Method) -> Recipe:
    """The one-step recipe that a fit uses, or begins with."""
    if isinstance(recipe, CalibratedRecipe):
        return recipe.step
    return recipe.start if isinstance(recipe, Shooting) else recipe


def _calibrations(
    benchmark: Benchmark, shared: PreparedBenchmark, recipes: Sequence[Method]
) -> dict[str, Calibration]:
    """Calibrations of all folds by the name of the recipe; found once for equal recipes."""
    intervals, training = shared.intervals, shared.training
    assert intervals is not None and training is not None
    out: dict[str, Calibration] = {}
    known: dict[str, Calibration] = {}
    for recipe in recipes:
        if isinstance(recipe, CalibratedRecipe):
            every = replace(recipe, use=tuple(p for p in PARTS if p in _freed(recipe)))
            key = repr(replace(every, name="", step=INTEGRAL))
            if key not in known:
                start = recipe.by.start.name
                given = shared.problems[start], shared.weights[start], training
                known[key] = calibrations_of(
                    every, intervals, *given, whole=not benchmark.folds.contiguous
                )
            out[recipe.name] = part_of_calibration(known[key], recipe.use)
    return out


def _freed(recipe: CalibratedRecipe) -> list[str]:
    return [block.name for block in recipe.by.blocks]


def _weights(benchmark: Benchmark, problem: Problem) -> Array:
    training = benchmark.folds.training(problem.recording, problem.time, problem.dt)
    if not training.any(axis=1).all():
        raise InputError(
            f"data set {benchmark.dataset.name!r}: fold {np.argmin(training.any(axis=1))} leaves "
            "nothing to train on: choose a smaller folds.gap, fewer folds or a shorter history"
        )
    return np.concatenate([training, np.ones((1, len(problem.r)))])


def run(
    benchmark: Benchmark,
    identifier: Identifier,
    recipe: Method,
    seed: int = 0,
    shared: PreparedBenchmark | None = None,
) -> Result:
    """Fit by a recipe in every fold and on all data, and score it all on what was held out.

    `shared` is what `prepare_benchmark` makes of the benchmark, where it has been made before.

    Raises
    ------
    InputError
        Where data, folds and settings do not fit together, or the identifier finds no numbers.
    """
    check_refinable(identifier, recipe)
    begin = time.perf_counter()
    shared = shared or prepare_benchmark(benchmark, [recipe])
    step = first_step(recipe)
    problem, weights = _problem(identifier, step, shared), shared.weights[step.name]
    ready = time.perf_counter()
    unit = shared.prepared.plant.mechanism.description.angle_unit
    found = None
    if isinstance(recipe, CalibratedRecipe) and not identifier.fixed:
        fitted, problem = _fit_calibrated(identifier, recipe, shared, seed, unit)
    else:
        fitted = fit(identifier, problem, weights, seed, unit)
    if isinstance(recipe, Shooting) and not identifier.fixed:
        assert shared.intervals is not None and shared.training is not None
        fitted, found = refine_folds(fitted, shared.intervals, recipe, shared.training)
    fitted = with_provenance(fitted, equations(fitted[-1], problem, weights[-1], found))
    done = time.perf_counter()
    friction, overall = fitted[:-1], fitted[-1]
    prepared = prepared_for(shared.prepared, fitted)
    views = None if identifier.fixed else shared.views.get(recipe.name)
    scores, motions = score_folds(friction, overall, prepared, benchmark.folds, views)
    tests, pictures = {}, list(motions)
    for test in shared.tests:
        tests[test.dataset.name], shown = score_model(overall, prepared_for(test, fitted))
        pictures += shown
    lines = np.concatenate([curves(friction, prepared.grid), curves(overall, prepared.grid)[None]])
    members = member_curves(overall, prepared.grid)
    if fitted.mechanism:  # what is no torque is no friction curve
        lines, members = np.full_like(lines, np.nan), members[:0]
    seconds = {"prepare": ready - begin, "fit": done - ready, "score": time.perf_counter() - done}
    return Result(
        *(scores, friction, overall, lines, tuple(pictures)),
        *(tests, seconds, prepared.grid, found, _loops(fitted, prepared, benchmark.protocol)),
        members,
    )


def _fit_calibrated(
    identifier: Identifier,
    recipe: CalibratedRecipe,
    shared: PreparedBenchmark,
    seed: int,
    unit: str,
) -> tuple[Friction, Problem]:
    """Friction (F + 1, n, P) with the calibration of each fold, and the problem of all data."""
    calibration, weights = shared.calibrations[recipe.name], shared.weights[recipe.step.name]
    parts: list[Friction | None] = [None] * len(weights)
    for folds, data in shared.views[recipe.name]:
        problem = training_of(data, recipe.step)
        fitted = fit(identifier, problem, weights[folds], seed, unit)
        for place, fold in enumerate(folds):
            parts[fold] = fitted[place]
    known = [part for part in parts if part is not None]
    if any(part.law != known[-1].law for part in known):
        raise InputError(
            f"{identifier!r} finds another law in each fold: give it a recipe without calibration"
        )
    theta = np.stack([np.asarray(part.theta) for part in known])
    fitted = replace(known[-1], theta=theta, calibration=calibration)
    return with_provenance(fitted, _lessons(known)), problem


def _lessons(parts: Sequence[Friction]) -> dict[str, Any]:
    """What frictions fitted one by one tell of their learning, as one table; NaN after an end."""
    told = [part.provenance.get("learning") for part in parts]
    if not told or any(own is None or len(own["training"]) != 1 for own in told):
        return {}
    out = {}
    for key in ("training", "held_out"):
        lines = [np.asarray(own[key][0]) for own in told if own is not None]
        longest = max(map(len, lines))
        out[key] = np.stack(
            [np.pad(x, (0, longest - len(x)), constant_values=np.nan) for x in lines]
        )
    return {"learning": out}


def _loops(fitted: Friction, prepared: Prepared, protocol: Protocol) -> tuple[HysteresisLoop, ...]:
    """Friction along sinusoids: of laws that remember, or of all where the protocol asks."""
    if fitted.mechanism or not (protocol.loops or fitted.law.has_memory):
        return ()
    interval = float(np.median(prepared.euler.dt))
    settings = protocol.loops or HysteresisSettings()
    return tuple(hysteresis_loops(fitted, prepared.plant[0], settings, prepared.grid, interval))


def _problem(identifier: Identifier, recipe: Recipe, shared: PreparedBenchmark) -> Problem:
    """The problem that an identifier fits: one of unit inertia, all of it, without physics."""
    if not identifier.uses_mechanism:
        return training_of(
            without_physics(shared.prepared), replace(recipe, velocity_threshold=0.0)
        )
    return shared.problems[recipe.name]


def view_of(identifier: Identifier, dataset: Dataset, recipe: Recipe) -> tuple[Plant, Recipe]:
    """Plant and recipe by which an identifier sees a data set: black boxes see no physics."""
    if not identifier.uses_mechanism:
        return unit_inertia_plant(dataset), replace(recipe, velocity_threshold=0.0)
    return plant_of(dataset), recipe


def check_refinable(identifier: Identifier, recipe: Method) -> None:
    """Refuse to refine by shooting what has no physics.

    Raises
    ------
    InputError
        Saying what to do.
    """
    if isinstance(recipe, Shooting | CalibratedRecipe) and not identifier.uses_mechanism:
        raise InputError(
            f"recipe {recipe.name!r}: shooting needs the physics that a black box lacks: give it "
            'recipes = ["integral"], or another one-step recipe'
        )


def fit(
    identifier: Identifier, problem: Problem, weights: Array, seed: int, angle_unit: str = "rad"
) -> Friction:
    """Friction (F, n, P) that an identifier finds under weights (F, K), checked.

    `angle_unit` is that of the mechanism's joints, "rad" or "m".

    Raises
    ------
    InputError
        Where it is not finite, or not one for each row of the weights and each joint.
    """
    friction = identifier.fit(problem, weights, seed)
    shape = np.shape(friction.theta)
    wanted = (len(weights), problem.r.shape[-1], len(friction.law.names))
    if shape != wanted:
        raise InputError(f"{identifier!r} gives theta of shape {shape}, it must be {wanted}")
    finite = np.isfinite(friction.theta).all(axis=(1, 2))
    if not finite.all():
        raise InputError(f"{identifier!r} gives numbers that are not finite")
    return replace(friction, angle_unit=angle_unit)


def compare(
    dataset: Dataset,
    identifiers: Mapping[str, Identifier],
    folds: Folds,
    recipes: Sequence[Method] = (INTEGRAL,),
    protocol: Protocol | None = None,
    seed: int = 0,
) -> dict[tuple[str, str], Result]:
    """Result of every identifier by every recipe, keyed by (identifier, recipe) names, one by one.

    Examples
    --------
    A comparison of one's own recordings::

        dataset = frictionid.load_dataset("my_rig")
        folds = make_folds(dataset.recordings, Split(count=10))
        models = {"none": Frictionless(), "stribeck": LeastSquares(Stribeck())}
        results = compare(dataset, models, folds)
    """
    benchmark = Benchmark(dataset, folds, protocol or Protocol())
    shared = prepare_benchmark(benchmark, recipes)
    return {
        (name, recipe.name): run(benchmark, identifier, recipe, seed, shared)
        for recipe in recipes
        for name, identifier in identifiers.items()
    }


def with_provenance(friction: Friction, entries: Mapping[str, Any]) -> Friction:
    """The friction, saying also where it comes from."""
    return replace(friction, provenance={**friction.provenance, **entries})
