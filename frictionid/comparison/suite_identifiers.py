"""Identifiers of a suite: built-in ones by their kind, others by module and class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from frictionid.comparison.kinds import built
from frictionid.comparison.registry import IDENTIFIERS
from frictionid.comparison.suite import IdentifierEntry
from frictionid.config import imported_for_suite, is_installed, nearest
from frictionid.errors import InputError
from frictionid.fitting.identifier import Identifier
from frictionid.fitting.method import Method
from frictionid.fitting.networks.network import Network


class NamedIdentifier(NamedTuple):
    """An identifier with its name in tables, and the recipes it is limited to, None for all."""

    name: str
    identifier: Identifier
    recipes: tuple[str, ...] | None = None

    def uses(self, recipe: Method) -> bool:
        """Whether it is fitted by a recipe."""
        return self.recipes is None or recipe.name in self.recipes


def identifier_of(
    entry: IdentifierEntry, folder: Path, recipes: Sequence[Method]
) -> NamedIdentifier:
    """Identifier of a suite's table; its kind may be of a module beside the suite, or installed.

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
        identifier = _imported(entry.kind, settings, folder, where)
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
    return identifier_of(IdentifierEntry(kind=kind, **settings), Path(), []).identifier


def _imported(kind: str, settings: Mapping[str, Any], folder: Path, where: str) -> Identifier:
    """Identifier of a class "package.module:Class", or what a function beside the suite makes."""
    part = imported_for_suite(kind, folder, where)
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


def on_device(part: Any, device: Any) -> Any:
    """The identifier with the networks in it that are trained by gradients on a device.

    Raises
    ------
    InputError
        For a device that is not there.
    """
    if isinstance(part, Network):
        return replace(part, device=device)
    if not is_dataclass(part) or isinstance(part, type):
        return part
    inner = {f.name: getattr(part, f.name) for f in fields(part) if f.init}
    moved = {name: on_device(value, device) for name, value in inner.items()}
    changed = {name: value for name, value in moved.items() if value is not inner[name]}
    return replace(part, **changed) if changed else part
