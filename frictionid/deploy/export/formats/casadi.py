"""Friction as functions of CasADi, with their derivatives: for optimal control [Andersson2019]."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.errors import needs
from frictionid.programs.program import Program

with needs("export"):
    import casadi

OPERATIONS: Mapping[str, Any] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "negative": lambda a: -a,
    "absolute": casadi.fabs,
    "sign": casadi.sign,
    "sqrt": casadi.sqrt,
    "exp": casadi.exp,
    "log": casadi.log,
    "log1p": casadi.log1p,
    "tanh": casadi.tanh,
    "arctan": casadi.atan,
    "sin": casadi.sin,
    "cos": casadi.cos,
    "maximum": casadi.fmax,
    "minimum": casadi.fmin,
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "equal": casadi.eq,
    "and": casadi.logic_and,
    "or": casadi.logic_or,
    "not": casadi.logic_not,
    "select": casadi.if_else,
}


class Functions(NamedTuple):
    """Friction of n parts, `casadi.Function`s of columns (n,).

    torque : of those of q, w, u and load that friction depends on, and memory, to Tf
    advance : of the same and dt [s], to memory after dt; None for static laws
    start : of the inputs alone, to memory at the start of a motion; None for static laws

    Memory is a matrix (n, m), a column for each entry.
    """

    torque: casadi.Function
    advance: casadi.Function | None = None
    start: casadi.Function | None = None


def casadi_functions(own: ExportedFriction, name: str = "friction") -> Functions:
    """Functions `NAME_torque`, `NAME_advance` and `NAME_start` of CasADi.

    As smooth as the law is: sgn(w) of a law is smoothed over its `width`.

    >>> import numpy as np
    >>> from frictionid.deploy.export.exported import exported
    >>> from frictionid.friction import Friction
    >>> from frictionid.friction.laws import CoulombViscous
    >>> friction = Friction(CoulombViscous(), np.array([[0.1, 0.02], [0.2, 0.01]]))
    >>> functions = casadi_functions(exported(friction))
    >>> functions.torque([1.0, -1.0])
    DM([0.12, -0.21])
    >>> functions.torque.jacobian()([1.0, -1.0], 0).full().round(3).diagonal().tolist()
    [0.02, 0.01]
    """
    programs = own.programs
    torque = _function(f"{name}_torque", programs.torque, own, ("memory",))
    if not programs.memory:
        return Functions(torque)
    return Functions(
        torque,
        _function(f"{name}_advance", programs.advance, own, ("memory", "dt")),
        _function(f"{name}_start", programs.start, own, ()),
    )


def _function(
    name: str, program: Program, own: ExportedFriction, others: tuple[str, ...]
) -> casadi.Function:
    """Function of a program: inputs of the law, and of `others` those that the law has."""
    programs, n = own.programs, len(own.joints)
    sizes = {group: (n, 1) for group in programs.inputs}
    if programs.memory:
        known = {"memory": (n, programs.memory), "dt": (1, 1)}
        sizes |= {group: known[group] for group in others}
    symbols = {group: casadi.SX.sym(group, *size) for group, size in sizes.items()}
    entries = {"dt_1": symbols.get("dt")}
    for group in programs.inputs:
        entries |= {f"{group}_{j + 1}": symbols[group][j] for j in range(n)}
    for i in range(programs.memory if "memory" in symbols else 0):
        entries |= {f"memory_{i + 1}_{j + 1}": symbols["memory"][j, i] for j in range(n)}
    columns = program.run(entries, OPERATIONS).values()
    made = casadi.horzcat(*(casadi.vertcat(*column) for column in columns))
    result = "Tf" if "Tf" in program.outputs else "memory_after"
    return casadi.Function(name, [*symbols.values()], [made], [*symbols], [result])


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """Files of the functions, which `casadi.Function.load` reads, and a text on what they are."""
    functions = casadi_functions(own, settings.name)
    files = {
        "" if part == "torque" else f"_{part}": function
        for part, function in functions._asdict().items()
        if function is not None
    }
    signatures = "\n".join(f"{function}" for function in files.values())
    text = "\n".join((*own.facts, "Read by casadi.Function.load:", signatures, ""))
    saved = {f"{ending}.casadi": _saved(function) for ending, function in files.items()}
    note = f'torque = casadi.Function.load("{settings.stem}.casadi"): {functions.torque}'
    return Written({**saved, ".txt": text.encode()}, notes=(note,))


def _saved(function: casadi.Function) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "function.casadi"
        function.save(str(path))
        return path.read_bytes()
