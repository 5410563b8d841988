"""Exported frictions, run by what reads their format: alike, on batches of motions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import casadi
import numpy as np
from test_programs import GROUPS

from frictionid.export.exported import ExportedFriction
from frictionid.export.formats import ExportSettings, writer_of
from frictionid.friction import Inputs


class Target(NamedTuple):
    """Functions on batches: inputs of the law (B, n) by name, memory (m, B, n), dt."""

    torque: Callable  # (inputs, memory) -> (B, n)
    start: Callable  # (inputs) -> (m, B, n)
    advance: Callable  # (inputs, memory, dt) -> (m, B, n)


def written(own: ExportedFriction, to: str, folder: Path, **settings) -> dict[str, Path]:
    """Files of a format, written into a folder; their paths by their endings."""
    files = writer_of(to)(own, ExportSettings(**settings)).files
    paths = {ending: folder / f"friction{ending}" for ending in files}
    for ending, content in files.items():
        paths[ending].write_bytes(content)
    return paths


def python(own, folder) -> Target:
    module: dict = {}
    exec(written(own, "python", folder)[".py"].read_text(), module)
    has_memory = bool(own.programs.memory)

    def each(name):
        def many(inputs, *others):
            """Others: memory (m, B, n) of laws with memory, dt."""
            rows = zip(*(group.tolist() for group in inputs.values()), strict=True)
            count = len(next(iter(inputs.values())))
            made = []
            for k, row in zip(range(count), rows, strict=True):
                own = [m[:, k].tolist() if isinstance(m, np.ndarray) else m for m in others]
                made.append(module[name](*row, *own))
            return np.moveaxis(np.array(made), 0, -2)

        return many

    torque = each("torque")
    return Target(
        lambda x, memory: torque(x, memory) if has_memory else torque(x),
        each("start"),
        each("advance"),
    )


def casadi_files(own, folder) -> Target:
    paths = written(own, "casadi", folder)
    has_memory, n = bool(own.programs.memory), len(own.joints)
    function = {end: casadi.Function.load(str(path)) for end, path in paths.items() if ".c" in end}

    def call(ending, inputs, *others):
        columns = [group.T for group in inputs.values()]
        count = columns[0].shape[1]
        for other in others:
            if isinstance(other, float):
                columns.append(np.full((1, count), other))
            else:  # (m, B, n) to (n, B m), a block for each
                columns.append(np.transpose(other, (2, 1, 0)).reshape(n, -1))
        made = function[f"{ending}.casadi"].map(count)(*columns).full()
        return made.reshape(n, count, -1).transpose(2, 1, 0)

    return Target(
        lambda x, memory: call("", x, *([memory] if has_memory else []))[0],
        lambda x: call("_start", x),
        lambda x, memory, dt: call("_advance", x, memory, dt),
    )


TARGETS = {"python": (python, 1e-9), "casadi": (casadi_files, 1e-9)}


def used(own: ExportedFriction, x: Inputs) -> dict[str, np.ndarray]:
    """Inputs that friction depends on, by name."""
    return {g: v for g, v in zip(GROUPS, x, strict=True) if g in own.programs.inputs}
