"""Friction as structured text of IEC 61131-3, for drives and PLCs: one function block.

The standard has no tanh and no sign: they stand before the block as functions of their own, written
by EXP such that it never overflows. Called once a cycle, the block advances its memory by `dt` and
gives the torques; `reset` begins a motion.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.expressions import Element, Function, element_of, functions

_HELPERS = {
    "exp": "{name} := EXP(MAX(MIN(a, {top}), -{top}));",
    "log1p": "{name} := LN(1.0 + a);",
    "sign": "{name} := SEL(a < 0.0, SEL(a > 0.0, 0.0, 1.0), -1.0);",
    "tanh": "b := EXP(-2.0 * MIN(ABS(a), 20.0));\n"
    "{name} := SEL(a < 0.0, 1.0, -1.0) * (1.0 - b) / (1.0 + b);",
}
_TOP = {"LREAL": "700.0", "REAL": "80.0"}  # of EXP


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A function block, and the functions that it calls."""
    real = "LREAL" if settings.precision == "double" else "REAL"
    block = _block(own, settings.name, real)
    facts = _comment("\n".join(own.facts))
    parts = [f"(*\n{settings.name}: friction of {len(own.joints)} parts.\n\n{facts}\n*)"]
    for name, body in _HELPERS.items():
        if f"{settings.name}_{name}(" in block:
            parts.append(_helper(f"{settings.name}_{name}", real, body))
    given = [*own.programs.inputs, *(["dt", "reset"] if own.programs.memory else [])]
    note = f"{settings.name}({', '.join(f'{x} := {x}' for x in given)}); once a cycle, then read Tf"
    return Written({".st": ("\n\n".join([*parts, block]) + "\n").encode()}, notes=(note,))


def _helper(name: str, real: str, body: str) -> str:
    lines = body.format(name=name, top=_TOP[real]).replace("\n", "\n    ")
    return (
        f"FUNCTION {name} : {real}\nVAR_INPUT\n    a : {real};\nEND_VAR\n"
        f"VAR\n    b : {real};\nEND_VAR\n    {lines}\nEND_FUNCTION"
    )


def _block(own: ExportedFriction, name: str, real: str) -> str:
    """The block: declarations, then its body."""
    n, entries = len(own.joints), own.programs.memory
    inputs, kept = [f"{x} : ARRAY[1..{n}] OF {real};" for x in own.programs.inputs], []
    if entries:
        time, table = own.law.sample_time, f"ARRAY[1..{entries}, 1..{n}] OF {real};"
        cycle = "time since the last call" if time is None else f"{time:g} s, the law's samples"
        inputs += [f"dt : {real}; (* [s], {cycle} *)", "reset : BOOL; (* a motion begins *)"]
        kept = ["is_started : BOOL;", f"memory : {table}", f"after : {table}"]
    bodies, values = {}, []
    for function in functions(own):
        code = ex.blocks(function.program, f"{function.name}_v")
        statements = [s for block in code for s in block.statements]
        values += [f"{s.name} : {'BOOL' if s.is_truth else real};" for s in statements]
        bodies[function.name] = _lines(function, code, own, name, real)
    lines = bodies["torque"]
    if entries:
        branches = ["IF reset OR NOT is_started THEN", *bodies["start"], "    is_started := TRUE;"]
        branches += ["ELSE", *bodies["advance"], "END_IF;"]
        lines = [*branches, "memory := after;", *lines]
    declared = [
        *_declared("VAR_INPUT", inputs),
        *_declared("VAR_OUTPUT", [f"Tf : ARRAY[1..{n}] OF {real};"]),
        *_declared("VAR", kept + values),
    ]
    return "\n".join([f"FUNCTION_BLOCK {name}", *declared, *lines, "END_FUNCTION_BLOCK"])


def _declared(kind: str, lines: list[str]) -> list[str]:
    return [kind, *(f"    {line}" for line in lines), "END_VAR"] if lines else []


def _lines(
    function: Function, code: tuple[ex.Block, ...], own: ExportedFriction, name: str, real: str
) -> list[str]:
    """Statements of a function; new memory goes to `after`, as all of the old is read before."""
    places, forms = {x: _at(element_of(x)) for x in function.program.inputs}, _forms(name)
    number = _numbers(real)

    def assigned(target: str, value: ex.Expression) -> str:
        return ex.folded(f"{target} := {ex.text(value, forms, number, places)};")

    lines = []
    for joint, (block, part) in enumerate(zip(code, own.joints, strict=False)):
        lines.append(f"    (* {_comment(part)} *)")
        lines += [assigned(s.name, s.expression) for s in block.statements]
        for output, value in block.outputs.items():
            target = _at(element_of(f"{output}_{joint + 1}"))
            lines.append(assigned(target.replace("memory", "after"), value))
    return lines


def _at(element: Element) -> str:
    if element.argument == "dt":
        return "dt"
    entry = f"{element.entry + 1}, " if element.argument == "memory" else ""
    return f"{element.argument}[{entry}{element.joint + 1}]"


def _comment(text: str) -> str:
    return text.replace("(*", "( *").replace("*)", "* )")


def _numbers(real: str) -> Callable[[float], str]:
    """Literals, which have a decimal point; infinity is a number that no torque reaches."""

    def text(value: float) -> str:
        bounded = min(max(value, -1e30), 1e30)
        number = repr(bounded) if real == "LREAL" else str(np.float32(bounded))
        mantissa, e, exponent = number.partition("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}{e.upper()}{exponent}"

    return text


def _forms(name: str) -> dict[str, ex.Form]:
    """Forms of structured text; SEL takes its last operand where the first is true."""
    return {
        **ex.SUMS,
        **{helper: ex.call(f"{name}_{helper}") for helper in _HELPERS},
        "absolute": ex.call("ABS"),
        "sqrt": ex.call("SQRT"),
        "log": ex.call("LN"),
        "arctan": ex.call("ATAN"),
        "sin": ex.call("SIN"),
        "cos": ex.call("COS"),
        "power": ex.call("EXPT", 2),
        "maximum": ex.call("MAX", 2),
        "minimum": ex.call("MIN", 2),
        "less": ex.infix("<", ex.COMPARED),
        "less_equal": ex.infix("<=", ex.COMPARED),
        "equal": ex.infix("=", ex.EQUAL),
        "and": ex.infix("AND", ex.BOTH),
        "or": ex.infix("OR", ex.EITHER),
        "not": ex.call("NOT "),
        "select": ex.Form("SEL({0}, {2}, {1})", ex.CALLED, (ex.ANY,) * 3),
        "number": ex.Form("SEL({}, 0.0, 1.0)", ex.CALLED, (ex.ANY,)),
        "truth": ex.Form("{} <> 0.0", ex.EQUAL, (ex.COMPARED,)),
    }
