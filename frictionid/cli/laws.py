"""frictionid laws: friction laws with their parameters."""

from __future__ import annotations

from frictionid.cli.kinds import KindName, list_kinds
from frictionid.cli.options import Json


def laws(name: KindName = "", json: Json = False) -> None:
    """List the friction laws of model files, with their equations, parameters and units."""
    from frictionid.comparison import kind_descriptions

    list_kinds(kind_descriptions.laws, name, json, "laws")
