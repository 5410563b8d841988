"""The comparison: every identifier by every recipe on identical folds.

What `run` does for one identifier and one recipe is a task: its folds are fitted together, the
friction of all data with them, and each is scored on what it was not fitted to.
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from frictionid.arrays import Array
from frictionid.data.recordings import Dataset
from frictionid.evaluation import (
    CalibratedView,
    Folds,
    HorizonErrors,
    Prepared,
    Protocol,
    initial_state_folds,
    nominal_torque_scores,
    prepare,
    prepared_for,
    score_folds,
    score_model,
    score_value,
    torque_example,
    trajectory_folds,
    with_speeds,
)
from frictionid.evaluation.curves import Beyond, beyond_motion
from frictionid.evaluation.hysteresis import HysteresisLoop, HysteresisSettings, hysteresis_loops
from frictionid.evaluation.score_frame import Score, with_scores
from frictionid.evaluation.statistics import effective_parameters
from frictionid.fitting.fit import Fit
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.parameter_block import Parameter
from frictionid.friction import Constraints, Friction

from .fit_model import with_notes
from .training_set import Method, TrainingSet, check_method, training_set


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
        """One held-out score, pooled over the folds."""
        return score_value(self.scores, score, statistic, horizon, joint)


class Benchmark(NamedTuple):
    """A data set with its folds, and data sets that only test what was fitted to it."""

    dataset: Dataset
    folds: Folds
    protocol: Protocol = Protocol()
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

    Parameters
    ----------
    benchmark : Benchmark
    identifier : Identifier
    recipe : Method
    seed : int
    shared : PreparedBenchmark, optional
        Of the benchmark, where it has been prepared before.
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
