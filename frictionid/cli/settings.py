"""Settings on the command line: --set key=value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def settings(texts: Iterable[str]) -> dict[str, Any]:
    """Settings by key; a dot in a key leads into a table, as in TOML.

    Raises
    ------
    InputError
        As `setting`, and for a key that is a value and a table.

    >>> settings(["symmetric=false", "bounds.viscous=[0, 1]", "bounds.coulomb=[0, 2]"])
    {'symmetric': False, 'bounds': {'viscous': [0, 1], 'coulomb': [0, 2]}}
    """
    from frictionid.errors import InputError

    out: dict[str, Any] = {}
    for key, value in map(setting, texts):
        *tables, name = key.split(".")
        place = out
        for table in tables:
            place = place.setdefault(table, {})
            if not isinstance(place, dict):
                raise InputError(f"--set {key}: {table!r} is a value already, and no table")
        place[name] = value
    return out


def setting(text: str) -> tuple[str, Any]:
    """Key and value of a setting, the value read as TOML where it is, else as text.

    Raises
    ------
    InputError
        Where there is no key, or no equals sign.

    >>> setting("symmetric=false"), setting("shape = arctan")
    (('symmetric', False), ('shape', ' arctan'))
    """
    from frictionid.config import parse_toml
    from frictionid.errors import InputError

    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set {text!r} must be key=value, e.g. --set symmetric=false")
    try:
        read = parse_toml(f"x = {value}", "--set")
    except InputError:
        read = {}
    return key.strip(), read["x"] if set(read) == {"x"} else value
