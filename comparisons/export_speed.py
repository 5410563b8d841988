"""Time of exported C for each joint and step: python comparisons/export_speed.py.

Compiled with gcc -O2; the least of 15 runs over 20,000 random velocities. Beside it stands the time
as a multiple of one tanh and one exp of the same machine.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import timeit
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from script import call

from frictionid.deploy.export.export import writer_of
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, exported
from frictionid.friction import Friction, Law
from frictionid.friction import laws as known

LAWS = {
    "coulomb_viscous": known.CoulombViscous(),
    "stribeck": known.Stribeck(),
    "quadratic": known.Quadratic(),
    "spline": known.Spline(),
    "lugre": known.LuGre(),
    "film_lag": known.FilmLag(),
    "mlp": known.MLP(),
    "window_mlp": known.WindowMLP(),
    "lstm": known.LSTM(),
}
COUNT, RUNS = 20_000, 15
LOOP = """#include <math.h>
#include "friction.h"
void steps(int count, const {real} *w, {memory} {real} *Tf)
{{ for (int k = 0; k < count; k++) {{ {calls} }} }}
void reference(int count, const {real} *w, {real} *Tf)
{{ for (int k = 0; k < 2 * count; k++) Tf[k] = tanh(w[k]) + exp(-w[k] * w[k]); }}
"""


def friction_of(law: Law) -> ExportedFriction:
    """Two joints with parameters that are none of them zero."""
    theta = np.array([law.initial[0]] * 2, dtype=float)
    return exported(Friction(law, theta if law.is_network else theta + 0.05), speeds=(2.0, 3.0))


def nanoseconds(own: ExportedFriction, precision: str, folder: Path) -> tuple[float, float]:
    """Of the friction and of the reference, each for one joint and step."""
    files = writer_of("c")(own, ExportSettings(precision=precision)).files
    for ending, content in files.items():
        (folder / f"friction{ending}").write_bytes(content)
    calls, memory = "friction_torque(w + 2 * k, Tf + 2 * k);", ""
    if own.programs.memory:
        memory = "friction_memory *m,"
        calls = "friction_advance(w + 2 * k, m, 0.01); friction_torque(w + 2 * k, m, Tf + 2 * k);"
    (folder / "loop.c").write_text(LOOP.format(real=precision, memory=memory, calls=calls))
    gcc = "gcc -std=c99 -O2 -shared -fPIC friction.c loop.c -o f.so -lm".split()
    subprocess.run(gcc, cwd=folder, check=True)
    library, kind = ctypes.CDLL(str(folder / "f.so")), np.dtype(precision.replace("float", "f4"))
    w = np.random.default_rng(0).uniform(-3.0, 3.0, (COUNT, 2)).astype(kind)
    memory_values = np.zeros((max(own.programs.memory, 1), 2), kind)
    kept = [memory_values.ctypes.data_as(ctypes.c_void_p)] * bool(own.programs.memory)
    ends = [a.ctypes.data_as(ctypes.c_void_p) for a in (w, np.zeros_like(w))]
    return (
        _least(lambda: library.steps(COUNT, ends[0], *kept, ends[1])),
        _least(lambda: library.reference(COUNT, *ends)),
    )


def _least(function: Callable[[], object]) -> float:
    return min(timeit.repeat(function, number=1, repeat=RUNS)) / COUNT / 2 * 1e9


def main(*, precision: Literal["double", "float"] = "double") -> None:
    """A line for each law."""
    print("law               ns  of one tanh and exp")
    for name, law in LAWS.items():
        with tempfile.TemporaryDirectory() as folder:
            own, reference = nanoseconds(friction_of(law), precision, Path(folder))
        print(f"{name:15} {own:5.0f}  {own / reference:.1f}")


if __name__ == "__main__":
    call(main)
