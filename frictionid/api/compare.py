"""frictionid.compare: friction models on identical folds, in memory."""

from collections.abc import Mapping, Sequence
from dataclasses import replace as with_changes
from pathlib import Path
from typing import Any, Literal

from joblib import cpu_count

from frictionid.comparison.cross_validate import (
    Benchmark,
    PreparedBenchmark,
    Result,
    prepare_benchmark,
)
from frictionid.comparison.results import results_in_memory
from frictionid.comparison.suite import NamedIdentifier, tasks_on
from frictionid.comparison.suite_recipes import usual_recipe, usual_sample_time
from frictionid.comparison.tasks import Outcome, Task, results_of
from frictionid.comparison.training_set import Method
from frictionid.config import distinct
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError, NoFitError
from frictionid.evaluation import Folds, Protocol, Split, make_folds, protocol_for
from frictionid.evaluation.folds import usual_kind
from frictionid.friction import Law
from frictionid.friction.model_files import LAWS
from frictionid.outputs import check_writable
from frictionid.progress import Done, counted, say_nothing

from .comparison import Comparison
from .fit import method_of
from .models import DatasetLike, count, dataset_of, identifier_of, name_of, numbers
from .suites import run_in_folder


def compare(
    data: DatasetLike,
    models: Mapping[str, Any] | Sequence[Any],
    folds: int | Split | Folds | None = None,
    recipes: str | Method | Sequence[str | Method] | None = None,
    seed: int = 0,
    *,
    horizons: Sequence[float] | None = None,
    tests: Sequence[DatasetLike] = (),
    initial_states: Literal["filter", "model"] = "filter",
    sample_time: float | None = None,
    whole: bool = False,
    jobs: int = 1,
    dask: str | None = None,
    folder: str | Path | None = None,
    replace: bool = False,
    done: Done = say_nothing,
) -> Comparison:
    """Compare friction models on identical folds.

    Parameters
    ----------
    data : Dataset, or path or name of one
    models : list of names, laws, identifiers or fits, or a mapping to these
        As in `frictionid.fit`; a fit is given, and is not fitted again. The names of a mapping
        stand in tables.
    folds : int, Split or Folds, optional
        How many: whole recordings where there are so many, else stretches of time. None: ten, or
        one for each recording where there are fewer.
    recipes : str, Method, or list of these, optional
        "integral", "study", "calibrated", "shooting", "inverse_dynamics", or a method; each fits
        every model. None: as `frictionid.fit` fits, once for each fold; where it would not fit all
        models alike, "calibrated", see `usual_recipe`. "integral" takes a second, and masses and
        clocks as given.
    seed : int
    horizons : list of float [s], optional
        Of the predictions. None: those of 0.1, 0.25, 0.5 and 1 s that the folds hold out, of
        arms 0.05, 0.1 and 0.2 s.
    tests : list of data sets that only test what was fitted
    initial_states : str
        Estimator of the states that predictions start from: "filter", the same for all models, or
        "model", each model's own.
    sample_time : float [s], optional
        Use samples at least this far apart.
    whole : bool
        Also simulate whole recordings from their start.
    jobs : int
        Number of models that are fitted side by side; 0: one for each core.
    dask : str, optional
        Address of the scheduler of a Dask cluster, whose workers fit the models.
    folder : str or Path, optional
        Result folder to write, with tables, pictures, models and a page; else all is in memory.
    replace : bool
        Whether an earlier comparison of that folder may be replaced.
    done : function, optional
        Called with the name of each model that is finished.

    Examples
    --------
    Three models on recordings of one's own, and where each of them predicts best::

        bench = frictionid.compare(data, ["none", "stribeck", frictionid.SINDy()], folds=10)
        print(bench)
        bench.plot("rollouts")
        bench["stribeck"].friction
    """
    dataset, jobs = dataset_of(data), count("jobs", jobs)
    named = [NamedIdentifier(name, identifier_of(model)) for name, model in _named(models)]
    methods, sample_time = _methods(dataset, named, recipes, sample_time)
    split = _folds(dataset, folds)
    protocol = Protocol(initial_states=initial_states, sample_time=sample_time, whole=whole)
    if horizons is None:
        protocol = protocol_for(protocol, [(dataset, split)])
    else:
        protocol = with_changes(protocol, horizons=tuple(numbers("horizons", horizons)))
    benchmark = Benchmark(dataset, split, protocol, tuple(map(dataset_of, tests)))
    benchmark, shared = _prepared(benchmark, methods, jobs or cpu_count(), fewer=horizons is None)
    tasks = tasks_on(benchmark, methods, named, [count("seed", seed)])
    prepared = {dataset.name: shared}
    settings = _settings(tasks[0])
    if folder is not None:
        place = Path(folder)
        check_writable(place)
        results = run_in_folder(
            tasks,
            prepared,
            (dataset.name, "", settings),
            place,
            jobs=jobs,
            dask=dask,
            replace=replace,
            done=lambda t: done(t.name),
        )
        kinds = dict.fromkeys(type(getattr(task.identifier, "law", None)) for task in tasks)
        laws = (kind for kind in kinds if issubclass(kind, Law) and kind not in LAWS.values())
        return Comparison(results, dataset, laws=tuple(laws))
    by_model: dict[tuple[str, str], tuple[Task, Outcome]] = {}
    with counted(len(tasks), "comparing", done) as step:
        for task, result in results_of(tasks, prepared, jobs=jobs, dask=dask):
            by_model[task.name, task.recipe.name] = task, result
            step(task.name)
    ordered = [by_model[task.name, task.recipe.name] for task in tasks]
    results = results_in_memory(dataset.name, settings, ordered, prepared)
    fitted = {key: r for key, (_, r) in by_model.items() if isinstance(r, Result)}
    return Comparison(results, dataset, fitted=fitted)


def _methods(
    dataset: Dataset,
    named: Sequence[NamedIdentifier],
    recipes: str | Method | Sequence[str | Method] | None,
    sample_time: float | None,
) -> tuple[list[Method], float | None]:
    """The methods that recipes name, or the usual one, and the time between their samples."""
    if recipes is None:
        recipes = usual_recipe(dataset, [model.identifier for model in named])
        if sample_time is None:
            sample_time = usual_sample_time(dataset, recipes)
    if isinstance(recipes, str) or not isinstance(recipes, Sequence):
        recipes = [recipes]
    methods = [method_of(recipe) for recipe in recipes]
    distinct([method.name for method in methods], "recipes")
    return methods, sample_time


def _settings(task: Task) -> dict[str, Any]:
    """Settings of a comparison, as a suite would have them."""
    protocol, folds = task.benchmark.protocol, task.benchmark.folds
    names = ("horizons", "every", "history", "sample_time")
    return {
        **{name: getattr(protocol, name) for name in names},
        "seeds": [task.seed],
        "folds": {"count": folds.count, "gap": folds.gap},
        "datasets": [{"path": task.benchmark.dataset.name}],
    }


def _named(models: Mapping[str, Any] | Sequence[Any]) -> list[tuple[str, Any]]:
    """Models with their names in tables, all different."""
    if isinstance(models, str) or not isinstance(models, Mapping | Sequence):
        models = [models]
    if isinstance(models, Mapping):
        return [(str(name), model) for name, model in models.items()]
    if not models:
        raise InputError("name at least one model to compare, such as 'stribeck'")
    names = [name_of(model) for model in models]
    labels = [
        name if names.count(name) == 1 else f"{name} {names[: i + 1].count(name)}"
        for i, name in enumerate(names)
    ]
    return list(zip(labels, models, strict=True))


def _folds(dataset: Dataset, folds: int | Split | Folds | None) -> Folds:
    """Folds of the recordings, of stretches of time where there are fewer recordings."""
    if isinstance(folds, Folds):
        return folds
    if not isinstance(folds, Split):
        folds = Split(count=None if folds is None else count("folds", folds))
    split, recordings = folds, len(dataset.recordings)
    if split.kind is None:
        few = recordings < split.folds(recordings)
        split = with_changes(split, kind="blocks" if few else usual_kind(dataset.recordings))
    return make_folds(dataset.recordings, split)


def _prepared(
    benchmark: Benchmark,
    methods: Sequence[Method],
    jobs: int,
    *,
    fewer: bool,
) -> tuple[Benchmark, PreparedBenchmark]:
    """The benchmark; with `fewer`, over the first horizons that its folds hold out."""
    try:
        return benchmark, prepare_benchmark(benchmark, methods, jobs)
    except NoFitError:  # of a calibration, over whatever horizon
        raise
    except InputError:
        protocol = benchmark.protocol
        if not fewer or len(protocol.horizons) == 1:
            raise
        protocol = with_changes(protocol, horizons=protocol.horizons[:-1])
        return _prepared(benchmark._replace(protocol=protocol), methods, jobs, fewer=True)
