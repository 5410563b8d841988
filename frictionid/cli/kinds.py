"""frictionid laws, identifiers and mechanisms: the kinds that can be named."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from frictionid.comparison.kind_descriptions import KindDescription


def list_kinds(
    kinds: "Callable[[], list[KindDescription]]", name: str, json: bool, command: str
) -> None:
    """Print all kinds in short, or all of one, or either as JSON."""
    import json as texts

    from frictionid.comparison.kind_descriptions import described
    from frictionid.files import plain
    from frictionid.report.console import show_kind, show_kinds

    chosen = [described(kinds(), name)] if name else kinds()
    if json:
        print(texts.dumps(plain(chosen), indent=1))
    elif name:
        show_kind(chosen[0])
    else:
        show_kinds(chosen, f"All of one: frictionid {command} NAME")


def laws(name: str = "", *, json: bool = False) -> None:
    """List the friction laws of model files, with their equations, parameters and units.

    Parameters
    ----------
    name : Show all of this one.
    """
    from frictionid.comparison import kind_descriptions

    list_kinds(kind_descriptions.laws, name, json, "laws")


def identifiers(name: str = "", *, json: bool = False) -> None:
    """List what --identifier of fit and [[identifiers]] of a suite can name, with settings.

    Parameters
    ----------
    name : Show all of this one.
    """
    from frictionid.comparison import kind_descriptions

    list_kinds(kind_descriptions.identifiers, name, json, "identifiers")


def mechanisms(name: str = "", *, json: bool = False) -> None:
    """List the mechanisms that [mechanism] of a data set can name, with parameters and units.

    Parameters
    ----------
    name : Show all of this one.
    """
    from frictionid.comparison import kind_descriptions

    list_kinds(kind_descriptions.mechanisms, name, json, "mechanisms")
