"""frictionid identifiers: kinds of identifiers with their settings."""

from __future__ import annotations

from frictionid.cli.kinds import KindName, list_kinds
from frictionid.cli.options import Json


def identifiers(name: KindName = "", json: Json = False) -> None:
    """List what --identifier of fit and [[identifiers]] of a suite can name, with settings."""
    from frictionid.comparison import kind_descriptions

    list_kinds(kind_descriptions.identifiers, name, json, "identifiers")
