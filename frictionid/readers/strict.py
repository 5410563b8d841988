"""Tables that people write: no unknown keys, no converted types, and mistakes told in one line."""

import difflib
import reprlib
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from frictionid.errors import InputError

Checked = TypeVar("Checked", bound=BaseModel)


# "10" is no number, 1 is no truth value, and nothing is infinite.
STRICT = ConfigDict(strict=True, allow_inf_nan=False)


def nearest(name: str, known: Iterable[str]) -> str:
    """Way out for an unknown name: the known one that looks most like it, or all of them.

    Examples
    --------
    >>> nearest("angel", ["time", "angle"])
    "did you mean 'angle'?"
    """
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(map(repr, names))}"


class Strict(BaseModel):
    """A table of a TOML file: no other keys, no conversion of types, no infinite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, **STRICT)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, table: Any) -> Any:
        strict = cls.model_config.get("extra") == "forbid"
        for key in table if strict and isinstance(table, dict) else ():
            if key not in cls.model_fields:
                raise ValueError(f"unknown key {key!r}; {nearest(key, cls.model_fields)}")
        return table


def mistake(invalid: ValidationError) -> str:
    """The first complaint of pydantic in one line: which key, which rule, what was given.

    One mistake at a time: the first one often causes the others.
    """
    error = invalid.errors(include_url=False)[0]
    place = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in error["loc"])
    if error["type"].startswith("missing"):
        return f"the key {place[1:]!r} is missing; add it"
    reason = error["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    if error["type"] == "value_error" and reason.startswith(f"{place[1:]}: "):
        return reason
    if error["type"] != "value_error":
        reason += f", not {reprlib.repr(error['input'])}"
    return f"{place[1:]}: {reason}" if place else reason


def checked(model: type[Checked], document: Mapping[str, Any], where: str) -> Checked:
    """The document as a model of its keys.

    Raises
    ------
    InputError
        At the first mistake, named with `where` the document stands.
    """
    try:
        return model.model_validate(document)
    except ValidationError as invalid:
        raise InputError(f"{where}: {mistake(invalid)}") from None
