"""Settings of the simulated rig (rig.toml) as dataclasses."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from frictionid.config import nearest, read_toml
from frictionid.errors import InputError
from frictionid.simulate.dataset_folder import ROBOT_FILES
from frictionid.simulate.rig import Rig

Settings = TypeVar("Settings")


def load_rig(path: str | Path) -> Rig:
    """Rig of a rig.toml.

    Raises
    ------
    InputError
        Where the file cannot be read, or a key is unknown or missing, or a value is not possible.
    """
    document = read_toml(Path(path), "name a rig.toml")
    return rig_of(_beside(document, Path(path).parent), str(path))


def _beside(document: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The document with the files of its mechanisms from a folder."""
    out = dict(document)
    for name in ("mechanism", "true_mechanism"):
        table = out.get(name)
        if isinstance(table, dict):
            files = {k: str(folder / str(table[k])) for k in ROBOT_FILES if k in table}
            out[name] = {**table, **files}
    return out


def rig_of(document: dict[str, Any], file: str) -> Rig:
    """Rig of a parsed rig.toml; `file` is its name in errors.

    Examples
    --------
    >>> rig_of({"nane": "demo"}, "rig.toml")
    Traceback (most recent call last):
        ...
    frictionid.errors.InputError: rig.toml: unknown key 'nane'; did you mean 'name'?
    """
    return settings_of(Rig, document, file)


def settings_of(kind: type[Settings], document: dict[str, Any], file: str) -> Settings:
    """A dataclass of settings from a parsed TOML document; `file` is its name in errors."""
    for place, key, names in _unknown_keys(document, kind, ""):
        raise InputError(f"{file}: {place}unknown key {key!r}; {nearest(key, names)}")
    try:
        # as JSON: lists become tuples, tables dataclasses, and nothing else is converted
        text = json.dumps(document, default=str)
        settings: Settings = TypeAdapter(kind).validate_json(text, strict=True)
    except ValidationError as invalid:
        error = invalid.errors(include_url=False)[0]
        raise InputError(f"{file}: {_sentence(error)}") from None
    return settings


def _sentence(error: Any) -> str:
    # pydantic's place has the tag of a union (the kind), the file's has not
    loc = [key for key in error["loc"] if key not in _KINDS]
    place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in loc).lstrip(".")
    if error["type"] == "missing":
        return f"the key {place!r} is missing; add it"
    reason = error["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    reason = reason.replace("an object", "a table").replace("a valid array", "a list")
    if error["type"] == "union_tag_not_found":
        reason = 'the key "kind" is missing; add it'
    elif error["type"] == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in error["ctx"]["expected_tags"].split(",")]
        reason = f"unknown kind {error['ctx']['tag']!r}; {nearest(str(error['ctx']['tag']), tags)}"
    elif error["type"] != "value_error":
        reason += f", not {error['input']!r:.60}"
    return f"{place}: {reason}" if place else reason


def _unknown_keys(table: Any, kind: Any, place: str) -> Iterator[tuple[str, str, list[str]]]:
    """Place, name and known names of each key that is no field of the dataclass `kind`."""
    if not (isinstance(table, dict) and is_dataclass(kind)):
        return
    hints = get_type_hints(kind)
    names = [field.name for field in fields(kind)]
    for key, value in table.items():
        if key not in names:
            yield f"{place}: " if place else "", key, names
            continue
        inner = f"{place}.{key}".lstrip(".")
        if isinstance(value, list):
            for i, entry in enumerate(value):
                yield from _unknown_keys(entry, _chosen(hints[key], entry), f"{inner}[{i}]")
        else:
            yield from _unknown_keys(value, _chosen(hints[key], value), inner)


def _chosen(hint: Any, table: Any) -> Any:
    """The dataclass of a table, among those of a type hint."""
    kinds = [hint] if is_dataclass(hint) else list(_dataclasses(hint))
    named = [d for d in kinds if isinstance(table, dict) and _kind(d) == table.get("kind")]
    return named[0] if named else None


def _dataclasses(hint: Any) -> Iterator[Any]:
    for part in get_args(hint):
        if is_dataclass(part):
            yield part
        else:
            yield from _dataclasses(part)


def _kind(cls: Any) -> Any:
    return next((field.default for field in fields(cls) if field.name == "kind"), None)


def _all_kinds(hint: Any) -> Iterator[str]:
    for cls in _dataclasses(hint):
        if kind := _kind(cls):
            yield kind
        for inner in get_type_hints(cls, include_extras=True).values():
            yield from _all_kinds(inner)


_KINDS = frozenset(_all_kinds(tuple[Rig, ...]))
