"""Tasks of a suite: every identifier by every recipe on every data set, with every seed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from frictionid.config import distinct, imported_for_suite
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError, located
from frictionid.evaluation import make_folds, protocol_for, true_calibration, true_friction
from frictionid.fitting.identifiers import Published
from frictionid.fitting.method import Method, check_method
from frictionid.mechanics import Mechanism, mechanism_of

from .cross_validate import Benchmark
from .suite import DatasetEntry, NamedIdentifier, Suite, check_recipes, identifier_of
from .suite_recipes import recipes_of
from .tasks import Task


def tasks_of(
    suite: Suite,
    file: Path,
    data: Path | None = None,
    *,
    trust: bool = False,
) -> list[Task]:
    """Tasks of the suite of a file, in the order in which tables show them.

    The truth of simulated data stands beside the identifiers.

    Parameters
    ----------
    suite : Suite
    file : Path
        Its paths lead from the folder of this file.
    data : Path, optional
        Folder with the tables of its one data set.
    trust : bool
        Whether code that the suite and its data sets name by its module may run.

    Raises
    ------
    InputError
        For unknown names, settings that do not fit, data that cannot be read.
    """
    folder = file.parent
    with located(str(file)):
        recipes = recipes_of(suite.recipes, folder)
        named = [identifier_of(e, folder, recipes, trust=trust) for e in suite.identifiers]
        distinct([recipe.name for recipe in recipes], "recipes")
        distinct(list(map(str, suite.seeds)), "seeds")
        benchmarks = benchmarks_of(suite, folder, data, trust=trust)
        tasks = [
            task
            for entry, benchmark in zip(suite.datasets, benchmarks, strict=True)
            for task in tasks_on(benchmark, used_recipes(entry, recipes), named, suite.seeds)
        ]
        distinct([task.file.lower() for task in tasks], "results")
    return tasks


def tasks_on(
    benchmark: Benchmark,
    recipes: Sequence[Method],
    identifiers: Sequence[NamedIdentifier],
    seeds: Sequence[int],
) -> list[Task]:
    """Tasks of one data set; the truth of simulated data stands beside the identifiers.

    Raises
    ------
    InputError
        Where names are not different, or an identifier fits neither a recipe nor the data.
    """
    every = [*identifiers, *_truth(benchmark)]
    distinct([named.name for named in every], "identifiers")
    for named in every:
        _check_given(named, (benchmark.dataset, *benchmark.tests))
    pairs = [(recipe, named) for recipe in recipes for named in every if named.uses(recipe)]
    for recipe, named in pairs:
        with located(f"identifier {named.name!r}"):
            check_method(recipe, named.identifier)
    return [
        Task(benchmark, named.name, named.identifier, recipe, seed)
        for recipe, named in pairs
        for seed in seeds
    ]


def used_recipes(entry: DatasetEntry, recipes: Sequence[Method]) -> list[Method]:
    """Recipes that are used on a data set."""
    check_recipes(entry.recipes or (), recipes, f"data set {entry.name or entry.path!r}")
    return [recipe for recipe in recipes if entry.recipes is None or recipe.name in entry.recipes]


def benchmarks_of(
    suite: Suite, folder: Path, data: Path | None, *, trust: bool = False
) -> list[Benchmark]:
    """Data, folds and protocol of each data set of a suite; each folder is read once."""
    if data is not None and len(suite.datasets) > 1:
        names = ", ".join(entry.path for entry in suite.datasets)
        raise InputError(
            f"--data names the folder of one data set, suite {suite.name!r} has several ({names}): "
            "set FRICTIONID_DATA to the folder that holds their collections"
        )
    places = dict.fromkeys(
        (path, entry.mechanism) for entry in suite.datasets for path in (entry.path, *entry.tests)
    )
    loaded = {
        (path, mechanism): load_dataset(
            folder / path, data, trust=trust, mechanism=_own_mechanism(mechanism, folder, trust)
        )
        for path, mechanism in places
    }
    benchmarks = [_benchmark(suite, entry, loaded) for entry in suite.datasets]
    # all by one protocol, so that tables have the same horizons
    protocol = protocol_for(suite.protocol, [(b.dataset, b.folds) for b in benchmarks])
    benchmarks = [replace(benchmark, protocol=protocol) for benchmark in benchmarks]
    distinct([d.name for b in benchmarks for d in (b.dataset, *b.tests)], "data sets")
    return benchmarks


def _own_mechanism(reference: str | None, folder: Path, trust: bool) -> Mechanism | None:
    """What a function of one's own gives, of a module beside the suite or of a package."""
    code = partial(imported_for_suite, folder=folder, where="datasets", trust=trust)
    return None if reference is None else mechanism_of({"kind": reference}, code)


def _benchmark(
    suite: Suite, entry: DatasetEntry, loaded: Mapping[tuple[str, str | None], Dataset]
) -> Benchmark:
    dataset = loaded[entry.path, entry.mechanism]
    tests = tuple(loaded[test, entry.mechanism] for test in entry.tests)
    dataset = dataset if entry.name is None else replace(dataset, name=entry.name)
    folds = make_folds(dataset.recordings, entry.folds or suite.folds)
    return Benchmark(dataset, folds, suite.protocol, tests)


def _truth(benchmark: Benchmark) -> list[NamedIdentifier]:
    """The true friction and calibration as an identifier named `truth`, where they are known."""
    truth = benchmark.dataset.truth
    friction = None if truth is None else true_friction(truth)
    if friction is None:
        return []
    friction = replace(friction, calibration=true_calibration(benchmark.dataset))
    return [NamedIdentifier("truth", Published(friction))]


def _check_given(named: NamedIdentifier, datasets: Sequence[Dataset]) -> None:
    """Complain about a given friction that is not one of these mechanisms."""
    if not isinstance(named.identifier, Published):
        return
    friction, where = named.identifier.friction, f"identifier {named.name!r}"
    for dataset in datasets:
        with located(f"{where} on {dataset.name!r}"):
            plant = plant_of(dataset, friction.parameters)
        shape = tuple(friction.theta.shape)
        if shape[:-1] != (plant.parts,):
            raise InputError(
                f"{where}: its theta has shape {shape}, data set {dataset.name!r} "
                f"has {plant.parts} joints: give one friction with as many joints"
            )
