"""A first verdict in a minute or two: check, a few laws on held-out motion, the one that predicts.

The rule is that of a comparison (`frictionid.evaluation.reference_model`), on fewer candidates:
the simplest law whose predictions are not practically worse than those of the best one. Laws are
fitted as `frictionid.fit` fits them: by shooting, of arms by inverse dynamics, where the torque
left takes the place of predictions. Only folds count that hold out motion: in others all errors are
noise. With fewer than three of them the law of the smallest error counts.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from joblib import cpu_count

from frictionid.arrays import Array, evenly
from frictionid.check import Verdict, check
from frictionid.comparison.cross_validate import (
    Benchmark,
    PreparedBenchmark,
    Result,
    prepare_benchmark,
    run,
)
from frictionid.comparison.processes import side_by_side
from frictionid.comparison.suite import IdentifierEntry, identifier_named
from frictionid.comparison.suite_recipes import CALIBRATED, recipe_of, time_between_samples
from frictionid.comparison.training_set import Method, TrainingSet, training_set
from frictionid.data.joint_scales import norm_of
from frictionid.data.readers.dataset import within
from frictionid.data.recordings import Dataset, Recording
from frictionid.errors import InputError, NoFitError
from frictionid.evaluation import (
    Folds,
    Prepared,
    Protocol,
    Split,
    make_folds,
    prepared_for,
    score_model,
    score_value,
)
from frictionid.evaluation.folds import usual_kind
from frictionid.evaluation.prepared import usual_interval
from frictionid.evaluation.reference_model import StartErrors, choose, preferring, unsupported
from frictionid.evaluation.score_frame import score_tables
from frictionid.evaluation.statistics import (
    REGION,
    nested_complexity,
    nested_names,
    shown_names,
    zero_names,
)
from frictionid.evaluation.torque_left import torque_frame
from frictionid.fitting.identifier import Identifier
from frictionid.friction.model_files import model_document
from frictionid.progress import Done, say_nothing
from frictionid.report.candidates import Measure

from .plan import Plan, plan_for
from .quick_report import Candidate, Quick

_FEWEST = 3  # recordings, below which stretches of time are held out
_ABOVE = 3.0  # times the angle noise: errors of folds that hold out motion
_SHORTEST, _LONG = 3.0, 5.0  # [s] of a recording: of longer ones several in part tell more


def quick(
    dataset: Dataset,
    done: Done = say_nothing,
    checked: Callable[[Verdict], object] = say_nothing,
    jobs: int = 1,
) -> Quick:
    """A first verdict on a data set: are the data good, and which friction do they show.

    `done` is called with the name of each step that is finished, see `Plan`, and `checked` with
    what the check says, before any law is fitted. `jobs` laws are
    fitted side by side, 0: one for each core.

    Raises
    ------
    InputError
        Where the recordings are too short to hold any motion out.

    Examples
    --------
    The verdict on recordings of one's own::

        print(quick(frictionid.load_dataset("my_rig")).chosen.name)
    """
    verdict = check(dataset)
    checked(verdict)
    done("check")
    if verdict.level == "unusable":
        return Quick(verdict)
    plan = plan_for(dataset)
    part, sample_time = shortened(dataset, plan.samples)
    horizon, results, not_fitted = _compared(part, plan, sample_time, done, jobs)
    each = np.array([joint.angle_noise for joint in verdict.joints])
    noise = norm_of(each, dataset.mechanism.position_units, dataset.scales.size)[0]
    least = 0.0 if plan.by_torque else _ABOVE * float(noise)
    moving, candidates, chosen = candidates_of(results, part, horizon, least)
    result = results[chosen.name]
    kept = () if chosen.refined is None else (e.block for e in chosen.refined.parameters)
    return Quick(
        check=verdict,
        seconds=part.seconds,
        horizon=horizon,
        free=tuple(dict.fromkeys(["friction", *kept])),
        folds=moving,
        candidates=candidates,
        chosen=chosen,
        friction=result.overall,
        refined=chosen.refined,
        velocity=result.grid,
        not_fitted=not_fitted,
    )


def shortened(dataset: Dataset, samples: int) -> tuple[Dataset, float | None]:
    """So many samples of all joints of a data set, and the time [s] between them.

    Fast samples are thinned first; then some recordings are taken, evenly spread; then the begin of
    each, from where it moves.
    """
    most = samples / np.shape(dataset.recordings[0].angle.value)[1]
    spans = np.array([r.angle.duration for r in dataset.recordings])
    sample_time = time_between_samples(dataset, samples)
    seconds = most * (sample_time or usual_interval(dataset))
    if spans.sum() <= seconds:
        return dataset, sample_time
    count = int(np.clip(seconds / min(spans.mean(), _LONG), min(_FEWEST, len(spans)), len(spans)))
    chosen = evenly(len(spans), count)
    each = max(seconds / len(chosen), _SHORTEST)
    several = [dataset.recordings[i] for i in chosen]
    begins = [max(min(_rest(r), r.angle.duration - each), 0.0) for r in several]
    parts = (within(r, begin, begin + each) for r, begin in zip(several, begins, strict=True))
    return replace(dataset, recordings=tuple(parts)), sample_time


def _rest(recording: Recording) -> float:
    """How long [s] no joint leaves its first angle, by 1 % of the widest motion of any."""
    q = recording.angle.value
    left = np.abs(q - q[0]) > 0.01 * np.ptp(q, axis=0).max()
    first = int(left.any(axis=1).argmax())
    return float(recording.angle.time[first] - recording.angle.time[0])


def _compared(
    dataset: Dataset,
    plan: Plan,
    sample_time: float | None,
    done: Done,
    jobs: int,
) -> tuple[float, dict[str, Result], tuple[str, ...]]:
    """The longest horizon that the folds hold out, NaN of torques, and the results of all laws.

    The last part says which laws cannot be fitted, and why.
    """
    recipe, folds = recipe_of(plan.recipe), _folds(dataset, plan.folds)
    for horizon in plan.horizons:
        protocol = Protocol(horizons=(horizon,), sample_time=sample_time)
        benchmark = Benchmark(dataset, folds, protocol)
        try:
            shared = prepare_benchmark(benchmark, [recipe])
            break
        except InputError:  # no fold holds out so much motion
            if horizon == plan.horizons[-1]:
                raise
    outcomes: dict[str, Result | NoFitError] = {}

    def fit(laws: Sequence[IdentifierEntry], done: Done) -> None:
        work, ended = partial(_outcome, benchmark, recipe, shared), {}
        for i, outcome in side_by_side(work, [(law,) for law in laws], jobs or cpu_count()):
            ended[i] = outcome
            done(laws[i].label)
        outcomes.update((law.label, ended[i]) for i, law in enumerate(laws))

    fit(plan.laws, done)
    if plan.further:
        with suppress(NoFitError):  # of the calibration
            fit(_shown(plan, shared.prepared, horizon, jobs), say_nothing)
        done(plan.steps[-1])
    results = {name: x for name, x in outcomes.items() if isinstance(x, Result)}
    errors = {name: x for name, x in outcomes.items() if isinstance(x, NoFitError)}
    if plan.laws[0].label in errors or len(results) < 2:  # no friction, or no law with it
        raise next(iter(errors.values()))
    reasons = tuple(f"{name}: {error}" for name, error in errors.items())
    return float("nan") if plan.by_torque else horizon, results, reasons


def _outcome(
    benchmark: Benchmark, recipe: Method, shared: PreparedBenchmark, law: IdentifierEntry
) -> Result | NoFitError:
    """The result of a law, or why it cannot be fitted."""
    try:
        return run(benchmark, _identifier(law), recipe, 0, shared)
    except NoFitError as error:
        return error


def _identifier(law: IdentifierEntry) -> Identifier:
    return identifier_named(law.kind, law.table)


def _shown(plan: Plan, prepared: Prepared, horizon: float, jobs: int) -> Sequence[IdentifierEntry]:
    """The further laws of a plan that predict practically better in one step than all others.

    All are fitted to the same data, corrected by one calibration, and judged on these: what seems
    to be shown is compared with the others later, on motion that is held out.
    """
    work = partial(_error, training_set(prepared, [CALIBRATED]), horizon)
    laws = *plan.laws, *plan.further
    errors = dict(side_by_side(work, [(law,) for law in laws], jobs or cpu_count()))
    count = len(plan.laws)
    least = np.nanmin([errors[i] for i in range(count)]) / (1.0 + REGION)
    return [law for i, law in enumerate(plan.further, count) if errors[i] < least]


def _error(training: TrainingSet, horizon: float, law: IdentifierEntry) -> float:
    """Error of a law's predictions of the data that it is fitted to, inf where it is not."""
    with suppress(NoFitError):
        friction = CALIBRATED.fit(_identifier(law), training, 0).friction
        scores = score_model(friction, prepared_for(training.prepared, friction)).scores
        return score_value(scores, "rollout_angle", "median", horizon)
    return float("inf")


def _folds(dataset: Dataset, most: int) -> Folds:
    kind = usual_kind(dataset.recordings, _FEWEST)
    count = min(len(dataset.recordings), most) if kind == "recordings" else most
    return make_folds(dataset.recordings, Split(count=count, kind=kind))


def candidates_of(
    results: Mapping[str, Result], dataset: Dataset, horizon: float, least: float
) -> tuple[int, tuple[Candidate, ...], Candidate]:
    """Number of folds that hold out motion, the laws compared on these, and the chosen one.

    horizon : [s], NaN where laws are compared by the torque left; least : error in such a fold
    """
    column = Measure(horizon).column
    tables = [score_tables(result.scores.assign(task=name)) for name, result in results.items()]
    by_fold = pd.concat([folds[column].droplevel("task") for folds, _ in tables], axis=1)
    moving = by_fold.index[by_fold.max(axis=1) > least].to_numpy()
    frictionless = np.array([result.overall.theta.size == 0 for result in results.values()])
    errors = [_starts(result, horizon, moving) for result in results.values()]
    counts = [_complexity(result) for result in results.values()]
    names = [nested_names(result.overall.law.names) for result in results.values()]
    refined = [
        r.refined.estimates(dataset, r.grid) if r.refined else None for r in results.values()
    ]
    shown = [shown_names(e) for e in refined]
    last = unsupported(errors, names, shown)
    choice = choose(errors, nested_complexity(counts, names), last, frictionless)
    models = [model_document(r.overall) if r.refined else {} for r in results.values()]
    choice = preferring(choice, names, shown, [zero_names(model) for model in models])
    candidates = tuple(
        Candidate(
            name=name,
            parameters=int(result.overall.theta.size),
            error=float(tables[i][1][column].iloc[0]),
            by_fold=by_fold.iloc[:, i].to_numpy(),
            curves=result.curves,
            standing=choice.standings[i] if choice.standings else "",
            loss=choice.losses[i] if choice.losses else None,
            lacks=i in choice.lacking,
            refined=refined[i],
            torque=torque_frame(result.scores.itertuples(index=False)),
        )
        for i, (name, result) in enumerate(results.items())
    )
    laws = [c for c in candidates if c.parameters]
    smallest = min(laws, key=lambda c: c.error)
    chosen = smallest if choice.adequate is None else candidates[choice.adequate]
    return len(moving), candidates, chosen


def _starts(result: Result, horizon: float, moving: Array) -> StartErrors:
    """Errors of predictions that start in some of the folds, or of the torque left."""
    assert result.errors is not None
    held_out = result.errors.held_out & np.isin(result.errors.fold, moving)
    return result.errors._replace(held_out=held_out).after(horizon)


def _complexity(result: Result) -> float:
    """Effective number of parameters, as in a comparison."""
    with suppress(InputError):
        return result.value("effective_parameters", "count")
    return float(result.overall.theta.size)
