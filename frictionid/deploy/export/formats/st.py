"""Friction as structured text of IEC 61131-3, for drives and PLCs: one function block.

The standard has no tanh and no sign: they stand before the block as functions of their own, written
by EXP such that it never overflows. Called once a cycle, the block advances its memory by `dt` and
gives the torques; `reset` begins a motion.
"""

from __future__ import annotations

import numpy as np

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written

_HELPERS = {
    "exp": "{name} := EXP(MAX(MIN(a, {top}), -{top}));",
    "log1p": "{name} := LN(1.0 + a);",
    "sign": "{name} := SEL(a < 0.0, SEL(a > 0.0, 0.0, 1.0), -1.0);",
    "tanh": "b := EXP(-2.0 * MIN(ABS(a), 20.0));\n"
    "{name} := SEL(a < 0.0, 1.0, -1.0) * (1.0 - b) / (1.0 + b);",
}
_TOP = {"LREAL": "700.0", "REAL": "80.0"}  # of EXP


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A function block, and the functions that it calls."""
    real = "LREAL" if settings.precision == "double" else "REAL"
    language = _language(settings.name, real)
    functions = ex.functions(model)
    code = [ex.blocks(f.program, f"{f.name}_v") for f in functions]
    lines = {
        f.name: _lines(f, parts, model, language) for f, parts in zip(functions, code, strict=True)
    }
    block = "\n".join(
        [
            f"FUNCTION_BLOCK {settings.name}",
            *_declarations(model, code, real),
            *_body(lines),
            "END_FUNCTION_BLOCK",
        ]
    )
    facts = _comment("\n".join(model.facts))
    parts = [f"(*\n{settings.name}: friction of {len(model.joints)} parts.\n\n{facts}\n*)"]
    for name, body in _HELPERS.items():
        if f"{settings.name}_{name}(" in block:
            parts.append(_helper(f"{settings.name}_{name}", real, body))
    arguments = [*model.programs.inputs, *(["dt", "reset"] if model.programs.memory else [])]
    call = ", ".join(f"{x} := {x}" for x in arguments)
    note = f"{settings.name}({call}); once a cycle, then read Tf"
    return Written({".st": ("\n\n".join([*parts, block]) + "\n").encode()}, notes=(note,))


def _helper(name: str, real: str, body: str) -> str:
    lines = body.format(name=name, top=_TOP[real]).replace("\n", "\n    ")
    return (
        f"FUNCTION {name} : {real}\nVAR_INPUT\n    a : {real};\nEND_VAR\n"
        f"VAR\n    b : {real};\nEND_VAR\n    {lines}\nEND_FUNCTION"
    )


def _declarations(
    model: ExportedFriction, functions: list[tuple[ex.Block, ...]], real: str
) -> list[str]:
    """Variables of the block: inputs, outputs, memory, and the named values of all functions."""
    n, entries = len(model.joints), model.programs.memory
    inputs = [f"{x} : ARRAY[1..{n}] OF {real};" for x in model.programs.inputs]
    variables = []
    if entries:
        time, table = model.law.sample_time, f"ARRAY[1..{entries}, 1..{n}] OF {real};"
        cycle = "time since the last call" if time is None else f"{time:g} s, the law's samples"
        inputs += [f"dt : {real}; (* [s], {cycle} *)", "reset : BOOL; (* a motion begins *)"]
        variables = ["is_started : BOOL;", f"memory : {table}", f"after : {table}"]
    statements = [s for code in functions for block in code for s in block.statements]
    variables += [f"{s.name} : {'BOOL' if s.is_truth else real};" for s in statements]
    declared = {
        "VAR_INPUT": inputs,
        "VAR_OUTPUT": [f"Tf : ARRAY[1..{n}] OF {real};"],
        "VAR": variables,
    }
    return [
        line
        for kind, lines in declared.items()
        if lines
        for line in (kind, *(f"    {x}" for x in lines), "END_VAR")
    ]


def _body(functions: dict[str, list[str]]) -> list[str]:
    """Statements of the block from those of its functions, by name."""
    if "start" not in functions:
        return functions["torque"]
    return [
        "IF reset OR NOT is_started THEN",
        *functions["start"],
        "    is_started := TRUE;",
        "ELSE",
        *functions["advance"],
        "END_IF;",
        "memory := after;",
        *functions["torque"],
    ]


def _lines(
    function: ex.Function,
    code: tuple[ex.Block, ...],
    model: ExportedFriction,
    language: ex.Language,
) -> list[str]:
    """Statements of a function; new memory goes to `after`, as all of the old is read before."""
    lines, places = [], {name: language.place(name) for name in function.program.inputs}
    for joint, block in enumerate(code):
        lines.append(f"    (* {_comment(model.joints[joint])} *)")
        for target, text, kind in language.lines(block, joint, places):
            if kind == "output":
                target = language.place(target).replace("memory", "after")
            lines.append(ex.folded(f"{target} := {text};"))
    return lines


def _comment(text: str) -> str:
    return text.replace("(*", "( *").replace("*)", "* )")


def _language(name: str, real: str) -> ex.Language:
    """Structured text; SEL takes its last operand where the first is true.

    Constants have a decimal point; infinity is a number that no torque reaches.
    """
    syntax: dict[str, str | ex.Form] = {
        **{helper: f"{name}_{helper}(" for helper in _HELPERS},
        **{"absolute": "ABS(", "sqrt": "SQRT(", "log": "LN(", "arctan": "ATAN(", "sin": "SIN("},
        **{"cos": "COS(", "power": "EXPT(", "maximum": "MAX(", "minimum": "MIN("},
        **{"less": "<", "less_equal": "<=", "equal": "=", "and": "AND", "or": "OR"},
        **{"not": "NOT (", "select": "SEL({0}, {2}, {1})", "number": "SEL({}, 0.0, 1.0)"},
        "truth": ex.Form("{} <> 0.0", ex.EQUAL, (ex.COMPARED,)),
    }

    def number(value: float) -> str:
        bounded = min(max(value, -1e30), 1e30)
        text = repr(bounded) if real == "LREAL" else str(np.float32(bounded))
        mantissa, e, exponent = text.partition("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e.upper()}{exponent}"

    return ex.Language(ex.forms(syntax), number, "memory[{}, {}]", 1)
