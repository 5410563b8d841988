"""The observer as C99, beside its friction; the controller gives M and dL/dq."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from frictionid.arrays import Array
from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportSettings, exported
from frictionid.deploy.export.formats import c
from frictionid.errors import InputError
from frictionid.files import write_bytes
from frictionid.outputs import check_outputs

from .watch import Watch


def write_code(watch: Watch, out: Path, read: Sequence[Path], *, replace: bool) -> tuple[Path, ...]:
    """Write a C source and its header; their paths.

    Raises
    ------
    InputError
        For laws with memory or loads, and parts that turn with several joints.
    """
    source, mechanism = watch.momentum_observer, watch.dataset.mechanism
    friction = source.friction
    if friction.law.has_memory or friction.law.uses_load or mechanism.coupled:
        raise InputError(
            "watch: code is for static laws of each joint without loads: fit another law, or run "
            "frictionid watch"
        )
    paths = out.with_suffix(".c"), out.with_suffix(".h")
    check_outputs(paths, read, replace=replace)
    model = exported(friction, mechanism.joints)
    settings = ExportSettings(stem=out.stem)
    written = c.write(model, settings).files
    arguments = [*ex.functions(model)[0].arguments, "Tf"]
    names = {"observer": source, "members": source.members, "band": watch.band, "array": _array}
    context = {**names, "motors": mechanism.motors, "arguments": arguments}
    head, body = (
        ex.rendered(f"observer.{ending}.j2", model, context).decode() for ending in ("h", "c")
    )
    end = "#ifdef __cplusplus\n}"
    header = written[".h"].decode().replace(end, f"{head}\n{end}")
    write_bytes(paths[0], written[".c"] + body.encode())
    write_bytes(paths[1], header.encode())
    return paths


def _array(values: Array) -> str:
    return "{" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "}"
