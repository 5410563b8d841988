"""The formats by name, and what writing one gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Literal

from frictionid.config import check_settings, nearest
from frictionid.errors import InputError
from frictionid.export.exported import ExportedFriction
from frictionid.friction import Friction


@dataclass(frozen=True)
class ExportSettings:
    """What a user may choose.

    name : prefix of functions and types in code, and name of what is exported
    precision : of the numbers in code, "double" or "float"
    into : file whose joints are given friction, of formats that describe a mechanism
    """

    name: str = "friction"
    precision: Literal["double", "float"] = "double"
    into: Path | None = None

    def __post_init__(self) -> None:
        check_settings(self)
        if not (self.name.isidentifier() and self.name.isascii()):
            raise InputError(
                f"name = {self.name!r} must be a name in code, of letters, digits and _"
            )


@dataclass(frozen=True)
class Written:
    """Files of an export.

    files : contents by the ending of their names, the first is the one that the user names
    lost : sentences on what the target cannot hold; none where it computes the same
    held : the friction that the target computes, where it is another one
    """

    files: Mapping[str, bytes]
    lost: tuple[str, ...] = ()
    held: Friction | None = field(default=None, compare=False)


Writer = Callable[[ExportedFriction, ExportSettings], Written]

_MODULES = {
    "python": "frictionid.export.python_code",
    "casadi": "frictionid.export.casadi_functions",
}
FORMATS = tuple(_MODULES)


def writer_of(name: str) -> Writer:
    """Function `write` of a format.

    Raises
    ------
    InputError
        For unknown formats.

    >>> writer_of("pyton")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    frictionid.errors.InputError: export format 'pyton' is unknown; ...
    """
    if name not in _MODULES:
        raise InputError(f"export format {name!r} is unknown; {nearest(name, FORMATS)}")
    found: Writer = import_module(_MODULES[name]).write
    return found
