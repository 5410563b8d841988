"""Suites: a comparison written as TOML, the identifiers that it names, and its tasks.

A suite is the constructor calls of its parts: every key of a table is a field of the dataclass that
the table's `kind` names. Identifiers are built in, or of a module beside the suite or installed.
Its tasks are every identifier by every recipe on every data set, with every seed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from frictionid.config import (
    STRICT,
    NonEmpty,
    Strict,
    checked,
    distinct,
    imported_for_suite,
    is_installed,
    nearest,
    read_toml,
)
from frictionid.data.plants import plant_of
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError, located
from frictionid.evaluation import (
    Protocol,
    Split,
    make_folds,
    protocol_for,
    true_calibration,
    true_friction,
)
from frictionid.files import suite_path
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.identifiers import Published
from frictionid.mechanics import mechanism_of

from .cross_validate import Benchmark
from .registry import IDENTIFIERS, Kind, built
from .search_space import Search, Tuning
from .suite_recipes import Name, RecipeEntry, recipes_of
from .tasks import Task
from .training_set import Method, check_method
from .variations import SensitivitySettings

SPLIT, PROTOCOL = Kind((Split,)), Kind((Protocol,))


def _split(table: Any) -> Any:
    return SPLIT.build(table, "folds") if isinstance(table, dict) else table


class DatasetEntry(Strict):
    """A data set to fit, and data sets that only test what was fitted to it.

    `name` in place of its own, `folds` in place of the suite's, `recipes` where only some are used:
    so one data set can stand there twice, split in two ways. `mechanism` names a function of one's
    own, `module:function`, that gives their mechanism in place of the kind that they name.
    """

    path: str
    tests: list[str] = []
    name: Name | None = None
    folds: Annotated[Split | None, BeforeValidator(_split)] = None
    recipes: NonEmpty[str] | None = None
    mechanism: Annotated[str, Field(pattern="^[^:]+:[^:]+$")] | None = None


class IdentifierEntry(Strict):
    """An identifier of a kind, ours or `package.module:Class`; its other keys are its settings.

    `search` says which of them tuning searches, and where; a comparison does not read it.
    """

    model_config = ConfigDict(extra="allow", frozen=True, **STRICT)

    kind: str
    name: Name | None = None
    recipes: NonEmpty[str] | None = None
    search: Search | None = None

    @property
    def table(self) -> dict[str, Any]:
        """Settings of the identifier."""
        return dict(self.model_extra or {})

    @property
    def label(self) -> str:
        """Name of the identifier in tables."""
        return self.name or self.kind.rpartition(":")[2]

    def with_settings(self, settings: Mapping[str, Any]) -> "IdentifierEntry":
        """The entry with more or other settings, and nothing to search."""
        keys = {key: getattr(self, key) for key in ("kind", "name", "recipes")}
        keys_given = {key: value for key, value in keys.items() if value is not None}
        return IdentifierEntry(**{**self.table, **settings, **keys_given})


class Suite(Strict):
    """A suite's tables; its file has the keys of the `protocol` beside the others."""

    settings: ClassVar[tuple[str, ...]] = PROTOCOL.settings
    name: Name
    title: str = ""
    protocol: Protocol = Protocol()
    seeds: NonEmpty[Annotated[int, Field(ge=0)]] = [0]
    folds: Annotated[Split, BeforeValidator(_split)] = Split()
    tune: Tuning = Tuning()
    sensitivity: SensitivitySettings = SensitivitySettings()
    datasets: NonEmpty[DatasetEntry]
    recipes: NonEmpty[RecipeEntry] = [RecipeEntry(name="integral")]
    identifiers: NonEmpty[IdentifierEntry]

    @model_validator(mode="before")
    @classmethod
    def _protocol(cls, table: Any) -> Any:
        """The table with the keys of the protocol in one object."""
        if not isinstance(table, dict) or "protocol" in table:
            return table
        keys = {key: table.pop(key) for key in PROTOCOL.settings if key in table}
        return {**table, "protocol": PROTOCOL.build(keys, "")}

    def document(self) -> dict[str, Any]:
        """The tables with all defaults, as their file would have them."""
        tables = self.model_dump(mode="json")
        return {**tables.pop("protocol"), **tables}


def load_suite(path: Path) -> Suite:
    """Suite of a TOML file, its keys and types checked."""
    tables = read_toml(suite_path(path))
    if "mechanism" in tables:
        raise InputError(
            f"{path} describes a data set; name a suite, such as the suite.toml that "
            "frictionid init writes beside it"
        )
    return checked(Suite, tables, str(path))


class NamedIdentifier(NamedTuple):
    """An identifier with its name in tables, and the recipes it is limited to, None for all."""

    name: str
    identifier: Identifier
    recipes: tuple[str, ...] | None = None

    def uses(self, recipe: Method) -> bool:
        """Whether it is fitted by a recipe."""
        return self.recipes is None or recipe.name in self.recipes


def identifier_of(
    entry: IdentifierEntry, folder: Path, recipes: Sequence[Method], *, trust: bool = False
) -> NamedIdentifier:
    """Identifier of a suite's table; its kind may be of a module beside the suite, or installed.

    Such code runs with `trust` only.
    """
    where = f"identifier {entry.label!r}"
    check_recipes(entry.recipes or (), recipes, where)
    settings = entry.table
    if entry.kind == "published" and isinstance(settings.get("file"), str):
        settings["file"] = str(folder / settings["file"])
    if ":" in entry.kind:
        identifier = _imported(entry.kind, settings, folder, where, trust)
    else:
        identifier = built({"kind": entry.kind, **settings}, IDENTIFIERS, where)
    return NamedIdentifier(entry.label, identifier, tuple(entry.recipes) if entry.recipes else None)


def check_recipes(names: Sequence[str], recipes: Sequence[Method], where: str) -> None:
    """Check that a suite has the recipes of these names."""
    suite_recipes = [recipe.name for recipe in recipes]
    for name in names:
        if name not in suite_recipes:
            raise InputError(
                f"{where}: the suite has no recipe {name!r}; {nearest(name, suite_recipes)}"
            )


def identifier_named(kind: str, settings: Mapping[str, Any]) -> Identifier:
    """Identifier of a kind with settings, as the command line and Python users give them.

    Examples
    --------
    >>> identifier_named("coulomb_viscous", {"width": 0.05}).law
    CoulombViscous(width=0.05, shape='tanh', symmetric=True)
    """
    for key in settings:
        if key in IdentifierEntry.model_fields:
            raise InputError(f"--set {key}: is no setting of an identifier")
    entry = IdentifierEntry(kind=kind, **settings)
    return identifier_of(entry, Path(), [], trust=True).identifier  # the user names the code


def _imported(
    kind: str, settings: Mapping[str, Any], folder: Path, where: str, trust: bool
) -> Identifier:
    """Identifier of a class "package.module:Class", or what a function beside the suite makes."""
    part = imported_for_suite(kind, folder, where, trust=trust)
    is_identifier = isinstance(part, type) and issubclass(part, Identifier)
    if is_installed(kind.partition(":")[0]) and not is_identifier:
        raise InputError(
            f"{where}: {kind!r} is no class derived from frictionid.Identifier, and "
            "installed packages are asked for nothing else"
        )
    try:
        identifier = part(**settings)
    except (TypeError, ValueError) as error:
        raise InputError(
            str(error) if isinstance(error, InputError) else f"{where}: {error}"
        ) from None
    if not isinstance(identifier, Identifier):
        raise InputError(
            f"{where}: {kind!r} is no identifier: derive it from "
            "frictionid.Identifier, with a method fit(problem, weights, seed)"
        )
    return identifier


# --- Tasks ----------------------------------------------------------------------------------------


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
    code = partial(imported_for_suite, folder=folder, where="datasets", trust=trust)
    loaded = {
        (path, kind): load_dataset(
            folder / path,
            data,
            trust=trust,
            mechanism=None if kind is None else mechanism_of({"kind": kind}, code),
        )
        for path, kind in places
    }
    benchmarks = [_benchmark(suite, entry, loaded) for entry in suite.datasets]
    # all by one protocol, so that tables have the same horizons
    protocol = protocol_for(suite.protocol, [(b.dataset, b.folds) for b in benchmarks])
    benchmarks = [benchmark._replace(protocol=protocol) for benchmark in benchmarks]
    distinct([d.name for b in benchmarks for d in (b.dataset, *b.tests)], "data sets")
    return benchmarks


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
