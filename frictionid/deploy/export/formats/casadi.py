"""Friction as functions of CasADi, with their derivatives: for optimal control [Andersson2019]."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from frictionid.errors import needs

from ..exported import ExportedFriction, ExportSettings, Written
from ..expressions import functions, operations

with needs("export"):
    import casadi

_NAMES = {
    "absolute": "fabs",
    "arctan": "atan",
    "equal": "eq",
    "maximum": "fmax",
    "minimum": "fmin",
    "select": "if_else",
    "and": "logic_and",
    "or": "logic_or",
    "not": "logic_not",
}
_OPERATIONS = operations(casadi, _NAMES)


def casadi_functions(model: ExportedFriction, name: str = "friction") -> dict[str, casadi.Function]:
    """Functions `NAME_torque`, `NAME_advance` and `NAME_start` of CasADi, of columns (n,).

    As smooth as the law is: sgn(w) of a law is smoothed over its `width`.

    torque : of those of q, w, u and load that friction depends on, and memory, to Tf
    advance : of the inputs of `torque` and dt [s], to memory after dt; of laws with memory
    start : of the inputs without memory, to memory at the start of a motion; of these, too

    Memory is a matrix (n, m), a column for each entry.

    >>> import numpy as np
    >>> from frictionid.deploy.export.exported import exported
    >>> from frictionid.friction import Friction
    >>> from frictionid.friction.laws import CoulombViscous
    >>> friction = Friction(CoulombViscous(), np.array([[0.1, 0.02], [0.2, 0.01]]))
    >>> torque = casadi_functions(exported(friction))["torque"]
    >>> torque([1.0, -1.0])
    DM([0.12, -0.21])
    >>> torque.jacobian()([1.0, -1.0], 0).full().round(3).diagonal().tolist()
    [0.02, 0.01]
    """
    n = len(model.joints)
    shapes = {"memory": (n, model.programs.memory), "dt": (1, 1)}
    parts = {}
    for part, arguments, program, _ in functions(model):
        symbols = {x: casadi.SX.sym(x, *shapes.get(x, (n, 1))) for x in arguments}
        entries = {
            f"{x}_{i + 1}_{j + 1}" if x == "memory" else f"{x}_{j + 1}": symbol[j, i]
            for x, symbol in symbols.items()
            for j, i in np.ndindex(*symbol.shape)
        }
        columns = program.run(entries, _OPERATIONS).values()
        value = casadi.horzcat(*(casadi.vertcat(*column) for column in columns))
        result = "Tf" if part == "torque" else "memory_after"
        parts[part] = casadi.Function(
            f"{name}_{part}", [*symbols.values()], [value], [*symbols], [result]
        )
    return parts


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """Files of the functions, which `casadi.Function.load` reads, and a text on what they are."""
    parts = casadi_functions(model, settings.name)
    files = {"" if x == "torque" else f"_{x}": function for x, function in parts.items()}
    signatures = "\n".join(f"{function}" for function in files.values())
    text = "\n".join((*model.facts, "Read by casadi.Function.load:", signatures, ""))
    saved = {f"{ending}.casadi": _saved(function) for ending, function in files.items()}
    note = f'torque = casadi.Function.load("{settings.stem}.casadi"): {parts["torque"]}'
    return Written({**saved, ".txt": text.encode()}, notes=(note,))


def _saved(function: casadi.Function) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "function.casadi"
        function.save(str(path))
        return path.read_bytes()
