"""The formats by name, and what writing one gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from frictionid.config import check_settings, nearest
from frictionid.deploy.export.exported import ExportedFriction
from frictionid.errors import InputError
from frictionid.friction import Friction


@dataclass(frozen=True)
class ExportSettings:
    """What a user may choose.

    name : prefix of functions and types in code, and name of what is exported
    precision : of the numbers in code, "double" or "float"
    into : file whose joints are given friction, of formats that describe a mechanism
    joints : their names in it, in the model's order, where they are not those of the data set
    randomise : number of samples of the parameters, in a file beside the others; 0 for none
    seed : of the samples
    stem : name of the files without their endings, for those that name each other
    """

    name: str = "friction"
    precision: Literal["double", "float"] = "double"
    into: Path | None = None
    joints: tuple[str, ...] = ()
    randomise: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    seed: int = 0
    stem: str = "friction"

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
    notes : sentences on what was changed, and on what else to know
    """

    files: Mapping[str, bytes]
    lost: tuple[str, ...] = ()
    held: Friction | None = field(default=None, compare=False)
    notes: tuple[str, ...] = ()


Writer = Callable[[ExportedFriction, ExportSettings], Written]

_MODULES = {
    "python": "frictionid.deploy.export.python_code",
    "c": "frictionid.deploy.export.c_code",
    "st": "frictionid.deploy.export.structured_text",
    "casadi": "frictionid.deploy.export.casadi_functions",
    "onnx": "frictionid.deploy.export.onnx_graph",
    "yaml": "frictionid.deploy.export.yaml_table",
    "latex": "frictionid.deploy.export.latex_text",
    "torchscript": "frictionid.deploy.export.torch_script",
    "mujoco": "frictionid.deploy.export.mujoco",
    "urdf": "frictionid.deploy.export.urdf",
    "isaac": "frictionid.deploy.export.isaac",
    "bam": "frictionid.deploy.export.bam",
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


def held_by(name: str) -> Callable[[ExportedFriction], Friction] | None:
    """Function that gives the friction which a format can hold; None of those that hold all."""
    found: Callable[[ExportedFriction], Friction] | None
    found = getattr(import_module(_MODULES[name]), "held", None)
    return found
