"""Exported frictions, run by what reads their format: alike, on batches of motions."""

import ctypes
import subprocess
import warnings
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import casadi
import numpy as np
import onnxruntime
import torch
from structured_text_runner import StructuredText
from test_programs import GROUPS

from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportSettings


class Target(NamedTuple):
    """Functions on batches: inputs of the law (B, n) by name, memory (m, B, n), dt."""

    torque: Callable  # (inputs, memory) -> (B, n)
    start: Callable  # (inputs) -> (m, B, n)
    advance: Callable  # (inputs, memory, dt) -> (m, B, n)


def written(own, to, folder, **settings):
    """Files of a format, written into a folder; their paths by their endings."""
    files = writer_of(to)(own, ExportSettings(**settings)).files
    paths = {ending: folder / f"friction{ending}" for ending in files}
    for ending, content in files.items():
        paths[ending].write_bytes(content)
    return paths


def python(own, folder):
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


def casadi_files(own, folder):
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


LOOPS = """#include "friction.h"
typedef {real} real;
void torques(int count, {pointers}{memory}real *Tf)
{{ for (int k = 0; k < count; k++) friction_torque({rows}{one}Tf + {n} * k); }}
"""
MEMORY_LOOPS = """
void starts(int count, {pointers}friction_memory *memory)
{{ for (int k = 0; k < count; k++) friction_start({rows}memory + k); }}
void advances(int count, {pointers}real dt, friction_memory *memory)
{{ for (int k = 0; k < count; k++) friction_advance({rows}memory + k, dt); }}
"""
STRICT = "-std=c99 -Wall -Wextra -pedantic -Werror -Wconversion -Wdouble-promotion".split()


def compiled(own, folder, precision="double"):
    """Library of the C code and of loops over cases; inputs are rows (B, n)."""
    written(own, "c", folder, precision=precision)
    n, x, has_memory = len(own.joints), own.programs.inputs, bool(own.programs.memory)
    loops = (LOOPS + MEMORY_LOOPS * has_memory).format(
        real=precision,
        n=n,
        pointers="".join(f"const real *{g}, " for g in x),
        rows="".join(f"{g} + {n} * k, " for g in x),
        memory="const friction_memory *memory, " * has_memory,
        one="memory + k, " * has_memory,
    )
    (folder / "loops.c").write_text(loops)
    gcc = ["gcc", *STRICT, "-O1", "-shared", "-fPIC", "friction.c", "loops.c", "-o", "f.so", "-lm"]
    subprocess.run(gcc, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "f.so"))


def c(own, folder, precision="double"):
    library = compiled(own, folder, precision)
    real = np.dtype(precision if precision == "double" else "float32")
    scalar = ctypes.c_double if precision == "double" else ctypes.c_float
    entries, n = own.programs.memory, len(own.joints)

    def call(name, inputs, *others):
        arrays = [np.ascontiguousarray(v, dtype=real) for v in inputs.values()]
        count = len(arrays[0])
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
        rest = [
            o.ctypes.data_as(ctypes.c_void_p) if isinstance(o, np.ndarray) else o for o in others
        ]
        getattr(library, name)(ctypes.c_int(count), *pointers, *rest)

    def structs(memory):  # (m, B, n) to structs (B, m, n)
        return np.ascontiguousarray(np.swapaxes(memory, 0, 1), dtype=real)

    def torque(inputs, memory):
        Tf = np.empty(next(iter(inputs.values())).shape, dtype=real)
        call("torques", inputs, *([structs(memory)] if entries else []), Tf)
        return Tf

    def start(inputs):
        made = np.empty((len(next(iter(inputs.values()))), entries, n), dtype=real)
        call("starts", inputs, made)
        return np.swapaxes(made, 0, 1)

    def advance(inputs, memory, dt):
        made = structs(memory)
        call("advances", inputs, scalar(dt), made)
        return np.swapaxes(made, 0, 1)

    return Target(torque, start, advance)


def structured_text(own, folder, precision="double"):
    """The block keeps its memory itself: it is called once a sample, with its inputs then."""
    text = written(own, "st", folder, precision=precision)[".st"].read_text()
    block = StructuredText(text)

    def call(inputs, **others):
        arrays = {
            g: {(j + 1,): v[:, j].astype(block.real) for j in range(v.shape[1])}
            for g, v in inputs.items()
        }
        block.call(**arrays, **others)
        return np.stack([block.variables["Tf"][(j + 1,)] for j in range(len(own.joints))], axis=1)

    def torque(inputs, memory):
        return memory if own.programs.memory else call(inputs)

    return Target(
        torque,
        lambda x: call(x, dt=block.real(0), reset=True),
        lambda x, _, dt: call(x, dt=block.real(dt), reset=False),
    )


def onnx_graphs(own, folder):
    """Start and step give memory and torques at once: the torque of the last of them is kept."""
    paths = written(own, "onnx", folder)
    sessions = {end: onnxruntime.InferenceSession(str(path)) for end, path in paths.items()}
    kept = {}

    def call(end, inputs, **others):
        named = {x: np.asarray(v, np.float32) for x, v in {**inputs, **others}.items()}
        kept["Tf"], *memory = sessions[end].run(None, named)
        return np.swapaxes(memory[0], 0, 1) if memory else kept["Tf"]

    return Target(
        lambda x, _: kept["Tf"] if own.programs.memory else call(".onnx", x),
        lambda x: call("_start.onnx", x),
        lambda x, memory, dt: call(".onnx", x, memory=np.swapaxes(memory, 0, 1), dt=[dt]),
    )


def loaded(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # TorchScript has a successor
        return torch.jit.load(str(path))


def torchscript(own, folder):
    module = loaded(written(own, "torchscript", folder)[".pt"])

    def call(function, inputs, *others):
        with torch.no_grad():
            return function(torch.tensor(np.concatenate([*inputs.values()], axis=1)), *others)

    def batched(memory):  # (m, B, n) to (B, m, n)
        return torch.tensor(np.swapaxes(memory, 0, 1))

    def outside(memory):
        return np.swapaxes(memory.numpy(), 0, 1)

    return Target(
        lambda x, memory: (
            call(module.torque, x, batched(memory)).numpy()
            if own.programs.memory
            else call(module, x).numpy()
        ),
        lambda x: outside(call(module.start, x)),
        lambda x, memory, dt: outside(
            call(module.advance, x, batched(memory), torch.tensor([dt], dtype=torch.float64))
        ),
    )


TARGETS = {
    "onnx": (onnx_graphs, 1e-5),
    "torchscript": (torchscript, 1e-9),
    "c": (c, 1e-9),
    "c_float": (partial(c, precision="float"), 1e-5),
    "st": (structured_text, 1e-9),
    "st_float": (partial(structured_text, precision="float"), 1e-5),
    "python": (python, 1e-12),
    "casadi": (casadi_files, 1e-9),
}


def used(own, x):
    """Inputs that friction depends on, by name."""
    return {g: v for g, v in zip(GROUPS, x[:4], strict=True) if g in own.programs.inputs}
