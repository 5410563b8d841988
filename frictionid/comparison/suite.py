"""Suites: a comparison written as TOML.

A suite is the constructor calls of its parts: every key of a table is an argument of the class or
function that the table's `kind` names.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, ConfigDict, Field, ValidationError

from frictionid.comparison.cross_validate import Benchmark, Method, check_refinable
from frictionid.comparison.registry import IDENTIFIERS, LAWS, folds, loops
from frictionid.comparison.search_space import Search, Tuning
from frictionid.comparison.suite_recipes import Name, Positive, RecipeEntry, recipes_of
from frictionid.comparison.tasks import Task
from frictionid.config import STRICT, Strict, built, called, distinct, imported, mistake, nearest
from frictionid.data.readers.dataset import load_dataset
from frictionid.data.recordings import Dataset
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split, make_folds, true_calibration, true_friction
from frictionid.evaluation.hysteresis import HysteresisSettings
from frictionid.friction import Friction
from frictionid.friction.model_files import load_model, own_law
from frictionid.identifiers import Identifier, Network, Published
from frictionid.mechanics import plant_of


def _split(table: Any) -> Any:
    return called(folds, table, "folds") if isinstance(table, dict) else table


class DatasetEntry(Strict):
    """A data set to fit, and data sets that only test what was fitted to it.

    `name` in place of its own, `folds` in place of the suite's, `recipes` where only some are used:
    so one data set can stand there twice, split in two ways.
    """

    path: str
    tests: list[str] = []
    name: Name | None = None
    folds: Annotated[Split | None, BeforeValidator(_split)] = None
    recipes: Annotated[list[str], Field(min_length=1)] | None = None


class IdentifierEntry(Strict):
    """An identifier of a kind, ours or `package.module:Class`; its other keys are its settings.

    `search` says which of them tuning searches, and where; a comparison does not read it.
    """

    model_config = ConfigDict(extra="allow", frozen=True, **STRICT)

    kind: str
    name: Name | None = None
    recipes: Annotated[list[str], Field(min_length=1)] | None = None
    search: Search | None = None


def _loops(table: Any) -> Any:
    return called(loops, table, "loops") if isinstance(table, dict) else table


class Suite(Strict):
    """A suite's tables as they are written."""

    renamed: ClassVar[Mapping[str, str]] = {
        "starts": "initial_states",
        "true_starts": "true_initial_states",
    }

    name: Name
    title: str = ""
    horizons: Annotated[list[Positive], Field(min_length=1)] = list(Protocol.horizons)
    every: Positive = Protocol.every
    history: Annotated[float, Field(ge=0)] = Protocol.history
    sample_time: Positive | None = None
    whole: bool = False
    initial_states: Literal["filter", "model"] = "filter"
    true_initial_states: bool = False
    seeds: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)] = [0]
    folds: Annotated[Split, BeforeValidator(_split)] = Split()
    loops: Annotated[HysteresisSettings | None, BeforeValidator(_loops)] = None
    tune: Tuning = Tuning()
    datasets: Annotated[list[DatasetEntry], Field(min_length=1)]
    recipes: Annotated[list[RecipeEntry], Field(min_length=1)] = [RecipeEntry(name="integral")]
    identifiers: Annotated[list[IdentifierEntry], Field(min_length=1)]


def load_suite(path: Path) -> Suite:
    """Suite of a TOML file, its keys and types checked.

    Raises
    ------
    InputError
        With the file, the key and the nearest known one.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such suite{_nearest_suite(path)}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    # ValueError: no UTF-8, no TOML, or an integer with thousands of digits
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no TOML ({error})") from None
    try:
        return Suite.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{path}: {mistake(error)}") from None


def tasks_of(
    suite: Suite, file: Path, data: Path | None = None, device: str | None = None
) -> list[Task]:
    """Tasks of the suite of a file; `data` is the folder with the tables of its one data set.

    The truth of simulated data stands beside the identifiers. `device` is where networks are
    trained, whatever the suite says.

    Raises
    ------
    InputError
        For unknown names, settings that do not fit, data that cannot be read.
    """
    try:
        return _tasks(suite, file.parent, data, device)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _tasks(suite: Suite, folder: Path, data: Path | None, device: str | None) -> list[Task]:
    if data is not None and len(suite.datasets) > 1:
        names = ", ".join(entry.path for entry in suite.datasets)
        raise InputError(
            f"--data names the folder of one data set, suite {suite.name!r} has several ({names}): "
            "set FRICTIONID_DATA to the folder that holds their collections"
        )
    recipes = recipes_of(suite.recipes)
    chosen = [identifier_of(entry, folder, recipes) for entry in suite.identifiers]
    if device is not None:
        chosen = [(name, on_device(own, device), only) for name, own, only in chosen]
    distinct([recipe.name for recipe in recipes], "recipes")
    distinct(list(map(str, suite.seeds)), "seeds")
    benchmarks = [benchmark_of(suite, entry, folder, data) for entry in suite.datasets]
    distinct([d.name for c in benchmarks for d in (c.dataset, *c.tests)], "data sets")
    tasks: list[Task] = []
    for benchmark, told in zip(benchmarks, suite.datasets, strict=True):
        entries = [*chosen, *truth_of(benchmark)]
        distinct([name for name, _, _ in entries], "identifiers")
        for name, identifier, _ in entries:
            _check_given(name, identifier, (benchmark.dataset, *benchmark.tests))
        for recipe in used_of(told, recipes):
            for name, identifier, only in entries:
                if only is None or recipe.name in only:
                    _check_refinable(name, identifier, recipe)
                    tasks += [Task(benchmark, name, identifier, recipe, s) for s in suite.seeds]
    distinct([task.file.lower() for task in tasks], "results")
    return tasks


def on_device(identifier: Any, device: Any) -> Any:
    """An identifier, the networks in it trained by gradients on a device; others are as they were.

    Raises
    ------
    InputError
        For a device that is not there.
    """
    if isinstance(identifier, Network):
        return replace(identifier, device=device)
    if not is_dataclass(identifier) or isinstance(identifier, type):
        return identifier
    parts = {f.name: getattr(identifier, f.name) for f in fields(identifier) if f.init}
    moved = {name: on_device(part, device) for name, part in parts.items()}
    other = {name: part for name, part in moved.items() if part is not parts[name]}
    return replace(identifier, **other) if other else identifier


def used_of(entry: DatasetEntry, recipes: Sequence[Method]) -> list[Method]:
    """Recipes that are used on a data set."""
    known = [recipe.name for recipe in recipes]
    for name in entry.recipes or ():
        if name not in known:
            raise InputError(
                f"data set {entry.name or entry.path!r}: the suite has no recipe {name!r}; "
                f"{nearest(name, known)}"
            )
    return [recipe for recipe in recipes if entry.recipes is None or recipe.name in entry.recipes]


def benchmark_of(suite: Suite, entry: DatasetEntry, folder: Path, data: Path | None) -> Benchmark:
    """Data, folds and protocol of one data set of a suite."""
    dataset = load_dataset(folder / entry.path, data)
    dataset = dataset if entry.name is None else replace(dataset, name=entry.name)
    tests = tuple(load_dataset(folder / test, data) for test in entry.tests)
    protocol = Protocol(
        tuple(suite.horizons),
        suite.every,
        suite.history,
        suite.sample_time,
        suite.whole,
        suite.initial_states,
        suite.true_initial_states,
        suite.loops,
    )
    return Benchmark(
        dataset, make_folds(dataset.recordings, entry.folds or suite.folds), protocol, tests
    )


def truth_of(benchmark: Benchmark) -> list[tuple[str, Identifier, None]]:
    """The true friction and calibration as an identifier named `truth`, where they are known."""
    truth = benchmark.dataset.truth
    friction = None if truth is None else true_friction(truth)
    if friction is None:
        return []
    return [
        (
            "truth",
            Published(replace(friction, calibration=true_calibration(benchmark.dataset))),
            None,
        )
    ]


def _check_refinable(name: str, identifier: Identifier, recipe: Method) -> None:
    try:
        check_refinable(identifier, recipe)
    except InputError as error:
        raise InputError(f"identifier {name!r}: {error}") from None


def _check_given(name: str, identifier: Identifier, datasets: Sequence[Dataset]) -> None:
    """Complain about a given friction that is not one of these mechanisms."""
    if not isinstance(identifier, Published):
        return
    for dataset in datasets:
        try:
            plant = plant_of(dataset, identifier.friction.parameters)
        except InputError as error:
            raise InputError(f"identifier {name!r} on {dataset.name!r}: {error}") from None
        shape = tuple(identifier.friction.theta.shape)
        if shape[:-1] != (plant.n,):
            raise InputError(
                f"identifier {name!r}: its theta has shape {shape}, data set {dataset.name!r} "
                f"has {plant.n} joints: give one friction with as many joints"
            )


def identifier_of(
    entry: IdentifierEntry, folder: Path, recipes: Sequence[Method]
) -> tuple[str, Identifier, tuple[str, ...] | None]:
    """Name, identifier and (where it is limited to some) recipes of a suite's identifier table.

    `kind` is one of ours, or `package.module:Class`, found beside the suite or installed.
    """
    name = entry.name or entry.kind.rpartition(":")[2]
    where = f"identifier {name!r}"
    known = [recipe.name for recipe in recipes]
    for recipe in entry.recipes or ():
        if recipe not in known:
            raise InputError(
                f"{where}: the suite has no recipe {recipe!r}; {nearest(recipe, known)}"
            )
    settings = dict(entry.model_extra or {})
    if entry.kind == "published" and isinstance(settings.get("file"), str):
        settings["file"] = str(folder / settings["file"])
    if ":" in entry.kind:
        identifier = _own(entry.kind, settings, folder, where)
    else:
        identifier = _ours({"kind": entry.kind, **settings}, where)
    return name, identifier, tuple(entry.recipes) if entry.recipes else None


def _ours(table: Mapping[str, Any], where: str) -> Identifier:
    try:
        made: Identifier = built(table, IDENTIFIERS, where)
    except InputError as error:  # of a class that does not know what it is part of
        told = str(error)
        raise InputError(told if told.startswith(where) else f"{where}: {told}") from None
    return made


def with_settings(entry: IdentifierEntry, settings: Mapping[str, Any]) -> IdentifierEntry:
    """An identifier's table with other settings, and nothing to search."""
    own = {key: getattr(entry, key) for key in ("kind", "name", "recipes")}
    given = {key: value for key, value in own.items() if value is not None}
    return IdentifierEntry(**{**(entry.model_extra or {}), **settings, **given})


def identifier_named(kind: str, settings: Mapping[str, Any]) -> Identifier:
    """Identifier by its kind and settings, as the command line gives them."""
    for key in settings:
        if key in IdentifierEntry.model_fields:
            raise InputError(f"--set {key}: is no setting of an identifier")
    return identifier_of(IdentifierEntry(kind=kind, **settings), Path(), [])[1]


def friction_of(path: Path, own_laws: Sequence[str] = ()) -> Friction:
    """Friction of a model file, whose law is built in or one of `module:Class`."""
    own = {law.__name__: law for law in map(own_law, own_laws)}
    return load_model(path, {**LAWS, **own})


def _own(kind: str, settings: Mapping[str, Any], folder: Path, where: str) -> Identifier:
    try:
        made = imported(kind, folder, where)(**settings)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {error}") from None
    if not isinstance(made, Identifier):
        raise InputError(
            f"{where}: {kind!r} is no identifier: derive it from "
            "frictionid.identifiers.Identifier, with a method fit(problem, weights, seed)"
        )
    return made


def _nearest_suite(path: Path) -> str:
    others = sorted(str(p) for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    near = get_close_matches(str(path), others, n=1)
    return f"; did you mean {near[0]}?" if near else ""
