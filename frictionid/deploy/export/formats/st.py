"""Friction as structured text of IEC 61131-3, for drives and PLCs: one function block.

The standard has no tanh and no sign: they stand before the block as functions of their own, written
by EXP such that it never overflows. Called once a cycle, the block advances its memory by `dt` and
gives the torques; `reset` begins a motion.
"""

import numpy as np

from frictionid.deploy.export import expressions as ex

from ..exported import ExportedFriction, ExportSettings, Written

_HELPERS = ("exp", "log1p", "sign", "tanh")  # whose bodies are in the template


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A function block, and the functions that it calls."""
    real = "LREAL" if settings.precision == "double" else "REAL"
    functions = ex.functions(model)
    code = {f.name: f.blocks(f"{f.name}_v") for f in functions}
    context = {
        "real": real,
        "language": _language(settings.name, real),
        "code": code,
        "comment": _comment,
        "functions": functions,
    }
    text = ex.rendered("block.st.j2", model, settings, context)
    arguments = [*model.programs.inputs, *(["dt", "reset"] if model.programs.memory else [])]
    call = ", ".join(f"{x} := {x}" for x in arguments)
    note = f"{settings.name}({call}); once a cycle, then read Tf"
    return Written({".st": text}, notes=(note,))


def _comment(text: str) -> str:
    return text.replace("(*", "( *").replace("*)", "* )")


def _language(name: str, real: str) -> ex.Language:
    """Structured text; SEL takes its last operand where the first is true.

    Constants have a decimal point; infinity is a number that no torque reaches.
    """
    syntax: dict[str, str | ex.Form] = {
        **{helper: f"{name}_{helper}(" for helper in _HELPERS},
        "absolute": "ABS(",
        "sqrt": "SQRT(",
        "log": "LN(",
        "arctan": "ATAN(",
        "sin": "SIN(",
        "cos": "COS(",
        "power": "EXPT(",
        "maximum": "MAX(",
        "minimum": "MIN(",
        "equal": "=",
        "and": "AND",
        "or": "OR",
        "not": "NOT (",
        "select": "SEL({0}, {2}, {1})",
        "number": "SEL({}, 0.0, 1.0)",
        "truth": ex.Form("{} <> 0.0", ex.EQUAL, (ex.COMPARED,)),
    }

    def number(value: float) -> str:
        bounded = min(max(value, -1e30), 1e30)
        text = repr(bounded) if real == "LREAL" else str(np.float32(bounded))
        mantissa, e, exponent = text.partition("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e.upper()}{exponent}"

    return ex.Language(ex.forms(syntax), number, "memory[{}, {}]", 1)
