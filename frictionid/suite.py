"""Suites: a comparison written as TOML, and the only place where parts have names.

A suite is the constructor calls of its parts: every key of a table is an argument of the class or
function that the table's `kind` names.
"""

from __future__ import annotations

import importlib
import sys
import tomllib
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, validate_call

from frictionid.compare import Contest
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split, make_folds, true_friction
from frictionid.friction import Friction
from frictionid.identifiers import Identifier, LeastSquares, Nothing, Published
from frictionid.laws import AsymmetricStribeck, CoulombViscous, MotorLoad, NoFriction, Stribeck
from frictionid.readers.dataset import load_dataset
from frictionid.recipe import INTEGRAL, STUDY, Recipe
from frictionid.states import RTS, Backward, Estimator, SavitzkyGolay
from frictionid.store import load_model
from frictionid.tasks import Task

Shape = Literal["tanh", "arctan"]

LAWS: Mapping[str, type] = {
    "none": NoFriction,
    "coulomb_viscous": CoulombViscous,
    "motor_load": MotorLoad,
    "stribeck": Stribeck,
    "stribeck_asymmetric": AsymmetricStribeck,
}


def none() -> Identifier:
    """No friction."""
    return Nothing()


def coulomb_viscous(width: float = 0.02, shape: Shape = "tanh") -> Identifier:
    """Coulomb and viscous friction by least squares."""
    return LeastSquares(CoulombViscous(width, shape))


def motor_load(width: float = 0.02, shape: Shape = "tanh") -> Identifier:
    """Coulomb and viscous friction, and a share of the motor torque, by least squares."""
    return LeastSquares(MotorLoad(width, shape))


def stribeck(symmetric: bool = True, width: float = 0.02, shape: Shape = "tanh") -> Identifier:
    """Stribeck friction by least squares, with levels of its own in each direction on request."""
    law = Stribeck(width, shape) if symmetric else AsymmetricStribeck(width, shape)
    return LeastSquares(law)


def published(file: str) -> Identifier:
    """The friction of a model file, with its own mechanism parameters."""
    return Published(load_model(Path(file), LAWS))


IDENTIFIERS: Mapping[str, Callable[..., Identifier]] = {
    "none": none,
    "coulomb_viscous": coulomb_viscous,
    "motor_load": motor_load,
    "stribeck": stribeck,
    "published": published,
}
ESTIMATORS: Mapping[str, Callable[..., Estimator]] = {
    "backward": Backward,
    "savgol": SavitzkyGolay,
    "rts": RTS,
}
RECIPES = (STUDY, INTEGRAL)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DatasetEntry(_Strict):
    """A data set to fit, and data sets that only test what was fitted to it."""

    path: str
    tests: tuple[str, ...] = ()


class RecipeEntry(_Strict):
    """A recipe: "study" or "integral" as they stand, or one's own states and scheme."""

    name: str
    states: dict[str, Any] | None = None
    scheme: str | None = None
    rest: float = 0.0


class Suite(_Strict):
    """A suite's tables as they are written."""

    name: str = Field(pattern=r"^[A-Za-z0-9_.-]+$")
    title: str = ""
    horizons: tuple[float, ...] = Protocol().horizons
    every: float = Field(Protocol().every, gt=0)
    history: float = Field(Protocol().history, ge=0)
    sample_time: float | None = Field(None, gt=0)
    seeds: tuple[int, ...] = (0,)
    folds: Split = Split()
    datasets: tuple[DatasetEntry, ...] = Field(min_length=1)
    recipes: tuple[RecipeEntry, ...] = (RecipeEntry(name="integral"),)
    identifiers: tuple[dict[str, Any], ...] = Field(min_length=1)


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
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: is no valid TOML ({error})") from None
    try:
        return Suite.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{path}: {_first(error, _known_keys)}") from None


def tasks_of(suite: Suite, folder: Path, data: Path | None = None) -> list[Task]:
    """Tasks of a suite whose file lies in `folder`; `data` is where the tables of its one data set lie.

    The truth of simulated data without memory stands beside the identifiers.

    Raises
    ------
    InputError
        For unknown names, settings that do not fit, data that cannot be read.
    """
    several = len({entry.path for entry in suite.datasets}) > 1
    if data is not None and several:
        names = ", ".join(entry.path for entry in suite.datasets)
        raise InputError(
            f"--data names the folder of one data set, suite {suite.name!r} has several ({names}): "
            "set FRICTIONID_DATA to the folder that holds their collections"
        )
    recipes = [recipe_of(entry) for entry in suite.recipes]
    chosen = [identifier_of(table, folder, recipes) for table in suite.identifiers]
    _distinct([name for name, _, _ in chosen], "identifiers")
    _distinct([recipe.name for recipe in recipes], "recipes")
    tasks = []
    for entry in suite.datasets:
        contest = contest_of(suite, entry, folder, data)
        for recipe in recipes:
            for name, identifier, only in [*chosen, *truth_of(contest)]:
                if only is None or recipe.name in only:
                    tasks += [Task(contest, name, identifier, recipe, s) for s in suite.seeds]
    return tasks


def contest_of(suite: Suite, entry: DatasetEntry, folder: Path, data: Path | None) -> Contest:
    """Data, folds and protocol of one data set of a suite."""
    dataset = load_dataset(folder / entry.path, data)
    tests = tuple(load_dataset(folder / test, data) for test in entry.tests)
    _distinct([dataset.name, *(test.name for test in tests)], "data sets")
    protocol = Protocol(suite.horizons, suite.every, suite.history, suite.sample_time)
    return Contest(dataset, make_folds(dataset.recordings, suite.folds), protocol, tests)


def truth_of(contest: Contest) -> list[tuple[str, Identifier, None]]:
    """The true friction as an identifier named `truth`, where it is known and free of memory."""
    truth = contest.dataset.truth
    friction = None if truth is None else true_friction(truth)
    return [] if friction is None else [("truth", Published(friction), None)]


def recipe_of(entry: RecipeEntry) -> Recipe:
    """Recipe of its table."""
    known = {recipe.name: recipe for recipe in RECIPES}
    if entry.states is None and entry.scheme is None:
        if entry.name not in known:
            raise InputError(
                f"recipe {entry.name!r} is none of {', '.join(known)}: give its states and scheme"
            )
        return known[entry.name]
    if entry.states is None or entry.scheme is None:
        raise InputError(f"recipe {entry.name!r} needs both states and scheme")
    where = f"recipe {entry.name!r}, states"
    return Recipe(entry.name, _build(entry.states, ESTIMATORS, where), entry.scheme, entry.rest)


def identifier_of(
    table: Mapping[str, Any], folder: Path, recipes: list[Recipe]
) -> tuple[str, Identifier, tuple[str, ...] | None]:
    """Name, identifier and (where it is limited to some) recipes of a suite's identifier table.

    `kind` is one of ours, or `package.module:Class`, found beside the suite or installed.
    """
    settings = {k: v for k, v in table.items() if k not in ("name", "recipes")}
    kind = str(settings.get("kind", ""))
    name = str(table.get("name", kind.rpartition(":")[2]))
    only = table.get("recipes")
    if only is not None:
        for recipe in only:
            if recipe not in [r.name for r in recipes]:
                raise InputError(f"identifier {name!r}: the suite has no recipe {recipe!r}")
    if kind == "published" and "file" in settings:
        settings["file"] = str(folder / settings["file"])
    where = f"identifier {name!r}"
    if ":" in kind:
        return name, _own(settings, folder, where), only and tuple(only)
    return name, _build(settings, IDENTIFIERS, where), only and tuple(only)


def identifier_named(kind: str, settings: Mapping[str, Any]) -> Identifier:
    """Identifier by its kind and settings, as the command line gives them."""
    return identifier_of({"kind": kind, **settings}, Path.cwd(), [])[1]


def friction_of(path: Path) -> Friction:
    """Friction of a model file whose law is one of ours."""
    return load_model(path, LAWS)


def _own(settings: Mapping[str, Any], folder: Path, where: str) -> Identifier:
    module, _, name = str(settings["kind"]).partition(":")
    for place in (str(folder.resolve()), str(Path.cwd())):
        if place not in sys.path:
            sys.path.append(place)
    try:
        found = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"{where}: {settings['kind']!r} cannot be imported ({error})") from None
    arguments = {k: v for k, v in settings.items() if k != "kind"}
    try:
        made = found(**arguments)
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {error}") from None
    if not hasattr(made, "fit"):
        raise InputError(f"{where}: {settings['kind']!r} has no method fit(problem, weights, seed)")
    return made  # type: ignore[no-any-return]


def _build(settings: Mapping[str, Any], known: Mapping[str, Callable[..., Any]], where: str) -> Any:
    kind = str(settings.get("kind", ""))
    if kind not in known:
        raise InputError(f"{where}: kind = {kind!r} is unknown{_nearest(kind, known)}")
    arguments = {k: v for k, v in settings.items() if k != "kind"}
    try:
        return validate_call(known[kind])(**arguments)
    except ValidationError as error:
        import inspect

        names = list(inspect.signature(known[kind]).parameters)
        raise InputError(f"{where}: {_first(error, lambda _: names)}") from None


def _first(error: ValidationError, known: Callable[[tuple[Any, ...]], list[str]]) -> str:
    """The first complaint of pydantic in one line, with the nearest known key."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{place!r} is unknown{_nearest(str(first['loc'][-1]), known(first['loc']))}"
    if first["type"] in ("missing", "missing_argument"):
        return f"{place!r} is missing"
    message = first["msg"].removeprefix("Value error, ")
    return f"{place} = {first.get('input')!r}: {message[:1].lower()}{message[1:]}"


def _known_keys(place: tuple[Any, ...]) -> list[str]:
    model: Any = Suite
    for part in place[:-1]:
        model = {"datasets": DatasetEntry, "recipes": RecipeEntry, "folds": Split}.get(part, model)
    return list(getattr(model, "model_fields", None) or model.__dataclass_fields__)


def _nearest(name: str, known: Any) -> str:
    near = get_close_matches(name, list(known), n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ";"
    return f"{hint} known are {', '.join(known) or 'none'}"


def _nearest_suite(path: Path) -> str:
    others = sorted(str(p) for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    near = get_close_matches(str(path), others, n=1)
    return f"; did you mean {near[0]}?" if near else ""


def _distinct(names: list[str], what: str) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"two {what} are called {twice[0]!r}: give one of them another name")
