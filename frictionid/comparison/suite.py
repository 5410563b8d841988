"""Suites: a comparison written as TOML.

A suite is the constructor calls of its parts: every key of a table is a field of the dataclass that
the table's `kind` names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from frictionid.comparison.kinds import Kind
from frictionid.comparison.search_space import Search, Tuning
from frictionid.comparison.sensitivity.settings import SensitivitySettings
from frictionid.comparison.suite_recipes import Name, RecipeEntry
from frictionid.config import STRICT, Strict, mistake, read_toml
from frictionid.errors import InputError
from frictionid.evaluation import Protocol, Split
from frictionid.evaluation.hysteresis import HysteresisSettings
from frictionid.files import suite_path

SPLIT, LOOPS = Kind((Split,)), Kind((HysteresisSettings,))
PROTOCOL = Kind((Protocol,), internal=frozenset({"loops"}))


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
    recipes: Annotated[list[str], Field(min_length=1)] | None = None
    mechanism: Annotated[str, Field(pattern="^[^:]+:[^:]+$")] | None = None


class IdentifierEntry(Strict):
    """An identifier of a kind, ours or `package.module:Class`; its other keys are its settings.

    `search` says which of them tuning searches, and where; a comparison does not read it.
    """

    model_config = ConfigDict(extra="allow", frozen=True, **STRICT)

    kind: str
    name: Name | None = None
    recipes: Annotated[list[str], Field(min_length=1)] | None = None
    search: Search | None = None

    @property
    def table(self) -> dict[str, Any]:
        """Settings of the identifier."""
        return dict(self.model_extra or {})

    @property
    def label(self) -> str:
        """Name of the identifier in tables."""
        return self.name or self.kind.rpartition(":")[2]

    def with_settings(self, settings: Mapping[str, Any]) -> IdentifierEntry:
        """The entry with more or other settings, and nothing to search."""
        keys = {key: getattr(self, key) for key in ("kind", "name", "recipes")}
        keys_given = {key: value for key, value in keys.items() if value is not None}
        return IdentifierEntry(**{**self.table, **settings, **keys_given})


class Suite(Strict):
    """A suite's tables; its file has the keys of the `protocol` beside the others."""

    settings: ClassVar[tuple[str, ...]] = (*PROTOCOL.settings, "loops")
    name: Name
    title: str = ""
    protocol: Protocol = Protocol()
    seeds: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)] = [0]
    folds: Annotated[Split, BeforeValidator(_split)] = Split()
    tune: Tuning = Tuning()
    sensitivity: SensitivitySettings = SensitivitySettings()
    datasets: Annotated[list[DatasetEntry], Field(min_length=1)]
    recipes: Annotated[list[RecipeEntry], Field(min_length=1)] = [RecipeEntry(name="integral")]
    identifiers: Annotated[list[IdentifierEntry], Field(min_length=1)]

    @model_validator(mode="before")
    @classmethod
    def _protocol(cls, table: Any) -> Any:
        """The table with the keys of the protocol in one object."""
        if not isinstance(table, dict) or "protocol" in table:
            return table
        keys = {key: table.pop(key) for key in PROTOCOL.settings if key in table}
        protocol: Protocol = PROTOCOL.build(keys, "")
        if "loops" in table:
            protocol = replace(protocol, loops=_loops(table.pop("loops")))
        return {**table, "protocol": protocol}

    def document(self) -> dict[str, Any]:
        """The tables with all defaults, as their file would have them."""
        tables = self.model_dump(mode="json")
        return {**tables.pop("protocol"), **tables}


def _loops(table: Any) -> HysteresisSettings:
    if not isinstance(table, dict):
        raise InputError(f"loops: it should be one table of keys and values, not {table!r}")
    loops: HysteresisSettings = LOOPS.build(table, "loops")
    return loops


def load_suite(path: Path) -> Suite:
    """Suite of a TOML file, its keys and types checked.

    Raises
    ------
    InputError
        With the file, the key and the nearest known one.
    """
    try:
        return Suite.model_validate(read_toml(suite_path(path)))
    except ValidationError as error:
        raise InputError(f"{path}: {mistake(error)}") from None
