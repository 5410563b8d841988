"""The comparison: every identifier by every recipe on identical folds.

What `run` does for one identifier and one recipe is a task: its folds are fitted together, the
friction of all data with them, and each is scored on what it was not fitted to. All tasks of a data
set share what is prepared of it, as a training set and to be scored.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.data.calibration import Calibration, stack_calibrations
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import (
    CalibratedView,
    Folds,
    HorizonErrors,
    Prepared,
    Protocol,
    calibrated_views,
    initial_state_folds,
    nominal_torque_scores,
    prepare,
    prepared_for,
    score_folds,
    score_model,
    score_value,
    torque_example,
    training_of,
    trajectory_folds,
    with_speeds,
    without_physics,
)
from frictionid.evaluation.complexity import effective_parameters
from frictionid.evaluation.curves import Beyond, beyond_motion
from frictionid.evaluation.hysteresis import HysteresisLoop, HysteresisSettings, hysteresis_loops
from frictionid.evaluation.score_frame import Score, with_scores
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.method import Method, check_method
from frictionid.fitting.one_step.formulation import Recipe
from frictionid.fitting.one_step.residual import Problem
from frictionid.fitting.parameters.parameter_block import Parameter
from frictionid.fitting.shooting import CalibratedRecipe, Intervals, intervals_of
from frictionid.fitting.shooting.recipe import PARTS, part_of_calibration
from frictionid.friction import Constraints, Friction
from frictionid.mechanics import Mechanism

from .processes import side_by_side


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """One data set as recipes fit it; mappings are by the names of the recipes.

    problems : one-step problems
    weights : (F + 1, K), positive for the rows that train each of the F folds and, last, for all
    measured : intervals of the measured angles, and their weights (F + 1, L)
    calibrations : (F + 1,), of all folds and of all data
    determined : how many of their parameters all data determine
    views : the data corrected by each of these calibrations
    """

    prepared: Prepared
    problems: Mapping[str, Problem]
    weights: Mapping[str, Array]
    measured: tuple[Intervals, Array] | None = None
    calibrations: Mapping[str, Calibration] = field(default_factory=dict)
    determined: Mapping[str, int] = field(default_factory=dict)
    views: Mapping[str, tuple[CalibratedView, ...]] = field(default_factory=dict)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism whose friction is fitted."""
        return self.prepared.plant.mechanism

    @property
    def intervals(self) -> Intervals:
        """Intervals of the measured angles, for recipes that need them."""
        assert self.measured is not None
        return self.measured[0]

    @property
    def interval_weights(self) -> Array:
        """Weights of these intervals, of those that train each fold and, last, of all."""
        assert self.measured is not None
        return self.measured[1]

    def without_mechanism(self, recipe: Recipe) -> Problem:
        """The problem of a recipe for joints of unit inertia; no stiction mask."""
        return training_of(without_physics(self.prepared), replace(recipe, velocity_threshold=0.0))

    def corrected(self, recipe: CalibratedRecipe) -> Iterator[tuple[Array, Problem]]:
        """Folds that share a calibration, and the problem on the data that it corrects."""
        for view in self.views[recipe.name]:
            yield view.folds, training_of(view.data, recipe.step)


def training_set(
    prepared: Prepared, recipes: Sequence[Method], folds: Folds | None = None, jobs: int = 1
) -> TrainingSet:
    """What the recipes fit of a data set, in each fold, if any, and as a whole.

    jobs : number of folds that are calibrated side by side

    Raises
    ------
    InputError
        Where a fold leaves nothing to train on, or recordings are too short.
    """
    steps = {step.name: step for recipe in recipes for step in recipe.steps}
    problems = {name: training_of(prepared, step) for name, step in steps.items()}
    weights = {name: _weights(prepared, folds, problem) for name, problem in problems.items()}
    data = TrainingSet(prepared, problems, weights)
    if any(recipe.needs_intervals for recipe in recipes):
        intervals = intervals_of(prepared.dataset, states=prepared.smoothed)
        data = replace(data, measured=(intervals, _training(folds, intervals)))
    return _calibrated(data, recipes, folds, jobs)


def _calibrated(
    data: TrainingSet, recipes: Sequence[Method], folds: Folds | None, jobs: int
) -> TrainingSet:
    """The training set with the calibrations of the recipes; equal ones are estimated once."""
    estimated: dict[str, tuple[Calibration, tuple[str, ...]]] = {}
    calibrations, determined = {}, {}
    for recipe in {r.name: r for r in (recipe.calibrated for recipe in recipes) if r}.values():
        key = repr(recipe.calibrator)
        if key not in estimated:
            estimated[key] = _of_folds(data, recipe.calibrator, folds, jobs)
        calibration, blocks = estimated[key]
        calibrations[recipe.name] = part_of_calibration(calibration, recipe.corrects)
        determined[recipe.name] = sum(
            block not in PARTS or block in recipe.corrects for block in blocks
        )
    views = {
        name: calibrated_views(data.prepared, calibration, len(data.interval_weights))
        for name, calibration in calibrations.items()
    }
    return replace(data, calibrations=calibrations, determined=determined, views=views)


def _of_folds(
    data: TrainingSet, recipe: CalibratedRecipe, folds: Folds | None, jobs: int
) -> tuple[Calibration, tuple[str, ...]]:
    """Calibrations (F + 1,), and the blocks of the parameters that all data determine.

    All folds have that of all data where they leave no windows to shoot at.
    """
    count = len(data.interval_weights)
    whole = folds is not None and not folds.contiguous
    rows = [-1] if whole else range(-1, count - 1)
    calls = [(data, fold) for fold in rows]
    by_call = dict(side_by_side(recipe.calibrate, calls, jobs))
    each = [by_call[i] for i in range(len(calls))]
    last, blocks = each[0]
    others = [last] * (count - 1) if whole else [calibration for calibration, _ in each[1:]]
    return stack_calibrations([*others, last]), blocks


def _training(folds: Folds | None, rows: Problem | Intervals) -> Array:
    """Weights (F + 1, K) of rows: of those that train each fold and, last, of all."""
    all_rows = np.ones((1, len(rows.dt)))
    if folds is None:
        return all_rows
    return np.concatenate([folds.training(rows.recording, rows.time, rows.dt), all_rows])


def _weights(prepared: Prepared, folds: Folds | None, problem: Problem) -> Array:
    weights = _training(folds, problem)
    if not weights.any(axis=1).all():
        raise InputError(
            f"data set {prepared.dataset.name!r}: fold {np.argmin(weights.any(axis=1))} leaves "
            "nothing to train on: choose a smaller folds.gap, fewer folds or a shorter history"
        )
    return weights


def with_notes(fit: Fit, *, intervals: bool = True) -> Friction:
    """Friction (F + 1, n, P) of a fit's folds and of all data, with what the fit says of all data.

    Sparse laws have an `equation` for each joint. Behind each coefficient stands its 95 % interval
    where the recipe shoots, and else its standard error in a one-step fit; `equation_errors` says
    which. One-step fits have `half_widths` (n, P) of 95 % intervals of the noise alone, NaN where
    there is none, and what they hold in words; networks have none, shooting has its own.
    """
    last, notes = fit.friction, dict[str, Any]()
    assert fit.folds is not None
    if last.law.is_sparse:
        shot = fit.diagnostics is not None
        bars = fit.half_widths() if shot else fit.errors()
        notes["equation"] = tuple(last.law.equation(last.theta, bars, last.position_units))
        notes["equation_errors"] = (
            "95 % intervals"
            if shot
            else ("standard errors of the noise alone, bias of the smoothing not included")
        )
    if intervals and fit.diagnostics is None and fit.covariance.parameters:
        notes["half_widths"] = fit.half_widths()
        notes["half_widths_hold"] = "noise alone, not the bias of smoothed states"
    return fit.folds.noted(notes)


def complexity_score(fit: Fit) -> Score | None:
    """Effective number of parameters of the friction of all data; None of recipes of one's own.

    Of a fit by shooting or inverse dynamics how many parameters, those of the machine and its
    sensors too, the data determine; those of a calibration count for every fit that it corrects.
    """
    friction, network = fit.friction, fit.friction.law.is_network
    if fit.fitted is not None and not network:
        covariance, constraints = fit.covariance, fit.fitted.constraints
        places = _once(covariance.parameters, constraints)
        count = float(covariance.determined[places].sum())
    elif fit.problem is not None and fit.weights is not None:
        count = effective_parameters(friction, fit.problem, fit.weights)
    elif network:
        count = float(np.size(friction.theta))
    else:
        return None
    return Score("all", "effective_parameters", "count", value=count + fit.beside)


def _once(parameters: Sequence[Parameter], constraints: Constraints | None) -> list[int]:
    """Places of the parameters, those of equal joints once."""
    if constraints is None or not constraints.equal:
        return list(range(len(parameters)))
    owner = constraints.owner
    return [
        k
        for k, p in enumerate(parameters)
        if p.block != "friction" or owner[p.place[0]] == p.place[0]
    ]


class Result(NamedTuple):
    """Outcome of a task: scores, friction of the folds and of all data, data of the pictures.

    `scores`, and `tests` by the names of the data sets, are score frames. `curves` stand at the
    velocities (V, n) of `grid`; `refined` is the result of shooting for all data. `loops` are of
    the folds and of all data. `beyond` is what the friction of the folds and, last, of all data
    says where no motion was recorded; None of black boxes. `torque` is measured and modelled torque
    over time, of all data; None where none was measured.
    """

    scores: pd.DataFrame
    friction: Friction
    overall: Friction
    curves: Array
    motions: tuple[dict[str, Any], ...]
    tests: Mapping[str, pd.DataFrame]
    seconds: Mapping[str, float]
    grid: Array
    refined: Fit | None = None
    loops: tuple[HysteresisLoop, ...] = ()
    beyond: Beyond | None = None
    errors: HorizonErrors | None = None
    torque: Mapping[str, Any] | None = None

    def value(
        self, score: str, statistic: str, horizon: float | None = None, joint: str = "all"
    ) -> float:
        """One held-out score, pooled over the folds; InputError where there is none."""
        return score_value(self.scores, score, statistic, horizon, joint)


@dataclass(frozen=True, eq=False)
class Benchmark:
    """A data set with its folds, and data sets that only test what was fitted to it."""

    dataset: Dataset
    folds: Folds
    protocol: Protocol = field(default_factory=Protocol)
    tests: tuple[Dataset, ...] = ()


class PreparedBenchmark(NamedTuple):
    """What all tasks of a benchmark share, made once.

    prepared, tests : the data sets as they are scored; training : the data set as it is fitted
    """

    prepared: Prepared
    tests: tuple[Prepared, ...]
    training: TrainingSet


def prepare_benchmark(
    benchmark: Benchmark, recipes: Sequence[Method], jobs: int = 1
) -> PreparedBenchmark:
    """States, problems, training rows, initial states and calibrations of a benchmark.

    jobs : number of folds that are calibrated side by side

    Raises
    ------
    InputError
        Where recordings, folds and protocol do not fit together.
    """
    prepared = prepare(benchmark.dataset, benchmark.protocol)
    # these complain where no fold holds out enough motion to predict
    initial_state_folds(prepared.initial_states, benchmark.folds, prepared.causal)
    if prepared.trajectory is not None:
        trajectory_folds(prepared.trajectory, benchmark.folds)
    training = training_set(prepared, recipes, benchmark.folds, jobs)
    tests = tuple(prepare(test, benchmark.protocol) for test in benchmark.tests)
    return PreparedBenchmark(prepared, tests, training)


def run(
    benchmark: Benchmark,
    identifier: Identifier,
    recipe: Method,
    seed: int = 0,
    shared: PreparedBenchmark | None = None,
) -> Result:
    """Fit an identifier in every fold and on all data, and score it on what was held out.

    shared : of the benchmark, where it has been prepared before

    Raises
    ------
    InputError
        Where data, folds and settings do not fit together, or the fit fails.
    """
    check_method(recipe, identifier)
    clock = [time.perf_counter()]
    shared = shared or prepare_benchmark(benchmark, [recipe])
    clock.append(time.perf_counter())
    fit = recipe.fit(identifier, shared.training, seed)
    friction = with_notes(fit, intervals=not identifier.fixed)
    clock.append(time.perf_counter())
    views = None if identifier.fixed else shared.training.views.get(recipe.name)
    result = score(friction, benchmark, shared, views)
    clock.append(time.perf_counter())
    seconds = dict(zip(("prepare", "fit", "score"), np.diff(clock).tolist(), strict=True))
    count = None if identifier.fixed else complexity_score(fit)
    if count is not None:
        result = result._replace(scores=with_scores(result.scores, [count]))
    return result._replace(refined=fit if fit.diagnostics else None, seconds=seconds)


def score(
    friction: Friction,
    benchmark: Benchmark,
    shared: PreparedBenchmark,
    views: Sequence[CalibratedView] | None,
) -> Result:
    """Scores of friction (F + 1, n, P): of the folds on what they hold out, of all data on tests.

    Tests are the benchmark's other data sets. The result has no times.

    views : the data corrected by the friction's calibrations, where they have been made before
    """
    folds, overall = friction[:-1], friction[-1]
    prepared = prepared_for(shared.prepared, friction)
    held_out = score_folds(folds, overall, prepared, benchmark.folds, views)
    motions, tests = held_out.motions, {}
    for test in shared.tests:
        tested = score_model(overall, prepared_for(test, friction))
        tests[test.dataset.name] = with_scores(tested.scores, nominal_torque_scores(test))
        motions = [*motions, *tested.motions]
    nominal = nominal_torque_scores(shared.prepared, benchmark.folds)
    return Result(
        scores=with_scores(held_out.scores, nominal),
        friction=folds,
        overall=with_speeds(overall, prepared),
        curves=held_out.curves,
        motions=tuple(motions),
        tests=tests,
        seconds={},
        grid=prepared.grid,
        loops=_loops(friction, prepared, benchmark.protocol),
        errors=held_out.errors,
        torque=torque_example(overall, shared.prepared),
        beyond=None if friction.mechanism else beyond_motion(friction, prepared.grid),
    )


def _loops(
    friction: Friction, prepared: Prepared, protocol: Protocol
) -> tuple[HysteresisLoop, ...]:
    """Friction along sinusoids: of laws with memory, or of all where the protocol asks."""
    if friction.mechanism or not (protocol.loops or friction.law.has_memory):
        return ()
    interval = float(np.median(prepared.euler.dt))
    settings = protocol.loops or HysteresisSettings()
    return tuple(hysteresis_loops(friction, prepared.plant[0], settings, prepared.grid, interval))
