"""Suites: a comparison written as TOML, and the identifiers that it names.

A suite is the constructor calls of its parts: every key of a table is a field of the dataclass that
the table's `kind` names. Identifiers are built in, or of a module beside the suite or installed.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from frictionid.config import (
    STRICT,
    NonEmpty,
    Strict,
    imported_for_suite,
    is_installed,
    mistake,
    nearest,
    read_toml,
)
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split
from frictionid.files import suite_path
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.method import Method

from .registry import IDENTIFIERS, Kind, built
from .search_space import Search, Tuning
from .suite_recipes import Name, RecipeEntry
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
    """Suite of a TOML file, its keys and types checked.

    Raises
    ------
    InputError
        With the file, the key and the nearest known one.
    """
    try:
        tables = read_toml(suite_path(path))
        if "mechanism" in tables:
            raise InputError(
                f"{path} describes a data set; name a suite, such as the suite.toml that "
                "frictionid init writes beside it"
            )
        return Suite.model_validate(tables)
    except ValidationError as error:
        raise InputError(f"{path}: {mistake(error)}") from None


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

    Raises
    ------
    InputError
        For unknown kinds, settings and recipes, and whatever the identifier itself complains about.
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
    """Check that a suite has the recipes of these names.

    Raises
    ------
    InputError
        With the nearest known name.
    """
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
