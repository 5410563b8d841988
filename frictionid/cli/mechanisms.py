"""frictionid mechanisms: kinds of mechanisms with their parameters."""

from __future__ import annotations

from frictionid.cli.kinds import KindName, list_kinds
from frictionid.cli.options import Json


def mechanisms(name: KindName = "", json: Json = False) -> None:
    """List the mechanisms that [mechanism] of a data set can name, with parameters and units."""
    from frictionid.comparison import kind_descriptions

    list_kinds(kind_descriptions.mechanisms, name, json, "mechanisms")
