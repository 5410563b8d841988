"""Settings on the command line: --set key=value."""

from __future__ import annotations

from typing import Any


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
