"""Friction as C99: a header and a source, no allocation, numbers in double or float."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.expressions import Element, Function, functions

_CALLS = {
    "absolute": "fabs",
    "sqrt": "sqrt",
    "exp": "exp",
    "log": "log",
    "log1p": "log1p",
    "tanh": "tanh",
    "arctan": "atan",
    "sin": "sin",
    "cos": "cos",
}
# which compilers put in place; fmax and fmin would be calls
_HELPERS = {
    ("max_of", ("a", "b")): "a > b ? a : b",
    ("min_of", ("a", "b")): "a < b ? a : b",
    ("sign_of", ("a",)): "({real})((a > 0) - (a < 0))",
}


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """Source and header, with functions of arrays that have an entry for each joint."""
    made = functions(own)
    files = {".c": _source(own, settings, made), ".h": _header(own, settings, made)}
    calls = "; ".join(_head(f, len(own.joints), settings) for f in made)
    note = f"compile with any C99 compiler and -lm; {calls}"
    return Written({ending: text.encode() for ending, text in files.items()}, notes=(note,))


def _header(own: ExportedFriction, settings: ExportSettings, made: tuple[Function, ...]) -> str:
    """Facts, types and declarations."""
    big, n, entries = settings.name.upper(), len(own.joints), own.programs.memory
    about = "\n".join(f" * {_comment(line)}" for line in own.facts)
    parts = [
        f"/*\n * {settings.name}: friction of {n} parts.\n *\n{about}\n */",
        f"#ifndef {big}_H\n#define {big}_H",
        '#ifdef __cplusplus\nextern "C" {\n#endif',
        f"#define {big}_JOINTS {n}",
    ]
    if entries:
        parts.append(
            "/* What friction remembers of the motion. */\n"
            f"typedef struct {{\n    {settings.precision} entry[{entries}][{n}];\n"
            f"}} {settings.name}_memory;"
        )
    parts += [f"/* {f.says} */\n{_head(f, n, settings)};" for f in made]
    parts += ["#ifdef __cplusplus\n}\n#endif", f"#endif /* {big}_H */"]
    return "\n\n".join(parts) + "\n"


def _source(own: ExportedFriction, settings: ExportSettings, made: tuple[Function, ...]) -> str:
    """Definitions of what the header declares."""
    n, real = len(own.joints), settings.precision
    bodies = [f"{_head(f, n, settings)}\n{{\n{_body(f, own, real)}\n}}" for f in made]
    parts = [f'#include "{settings.stem}.h"\n\n#include <math.h>']
    for (name, arguments), value in _HELPERS.items():
        if any(f"{name}(" in body for body in bodies):
            given = ", ".join(f"{real} {x}" for x in arguments)
            returned = value.format(real=real)
            parts.append(f"static {real} {name}({given})\n{{\n    return {returned};\n}}")
    return "\n\n".join([*parts, *bodies]) + "\n"


def _head(function: Function, n: int, settings: ExportSettings) -> str:
    real, own = settings.precision, f"{settings.name}_memory *memory"
    types = {"memory": f"const {own}" if function.name == "torque" else own, "dt": f"{real} dt"}
    arguments = [types.get(x, f"const {real} {x}[{n}]") for x in function.arguments]
    arguments += {"torque": [f"{real} Tf[{n}]"], "start": [own]}.get(function.name, [])
    return f"void {settings.name}_{function.name}({', '.join(arguments)})"


def _body(function: Function, own: ExportedFriction, real: str) -> str:
    """All inputs are read first, so that memory can be written over."""
    code, forms, number = function.code, _forms(real), _numbers(real)
    read = function.read(code)
    arguments = {element.argument for element in read.values()}
    lines = [f"    (void){x};" for x in function.arguments if x not in {*arguments, "memory"}]
    if function.name == "torque" and "memory" in set(function.arguments) - arguments:
        lines.append("    (void)memory;")
    lines += [f"    const {real} {name} = {_at(element)};" for name, element in read.items()]
    for joint, (block, name) in enumerate(zip(code, own.joints, strict=False)):
        lines.append(f"\n    /* {_comment(name)} */")
        for statement in block.statements:
            kind = "int" if statement.is_truth else real
            made = ex.text(statement.expression, forms, number)
            lines.append(ex.folded(f"const {kind} {statement.name} = {made};"))
        for k, value in enumerate(block.outputs.values()):
            target = f"Tf[{joint}]" if function.name == "torque" else f"memory->entry[{k}][{joint}]"
            lines.append(ex.folded(f"{target} = {ex.text(value, forms, number)};"))
    return "\n".join(lines)


def _comment(text: str) -> str:
    """Text within a comment, which it neither ends nor begins anew."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("?", ".")


def _at(element: Element) -> str:
    if element.argument == "dt":
        return "dt"
    if element.argument == "memory":
        return f"memory->entry[{element.entry}][{element.joint}]"
    return f"{element.argument}[{element.joint}]"


def _forms(real: str) -> dict[str, ex.Form]:
    """Forms of C; functions of floats end in f."""
    end = "f" if real == "float" else ""
    return {
        **ex.SUMS,
        **{operation: ex.call(f"{name}{end}") for operation, name in _CALLS.items()},
        "power": ex.call(f"pow{end}", 2),
        "maximum": ex.call("max_of", 2),
        "minimum": ex.call("min_of", 2),
        "sign": ex.call("sign_of"),
        "less": ex.infix("<", ex.COMPARED),
        "less_equal": ex.infix("<=", ex.COMPARED),
        "equal": ex.infix("==", ex.EQUAL),
        "and": ex.infix("&&", ex.BOTH),
        "or": ex.infix("||", ex.EITHER),
        "not": ex.Form("!{}", ex.CALLED, (ex.CALLED,)),
        "select": ex.Form("{} ? {} : {}", ex.CHOSEN, (ex.EITHER,) * 3),
        "number": ex.Form(f"({real}){{}}", ex.CALLED, (ex.CALLED,)),
        "truth": ex.Form("{} != 0", ex.EQUAL, (ex.COMPARED,)),
    }


def _numbers(real: str) -> Callable[[float], str]:
    """Literals of C, the shortest that give the number back."""

    def text(value: float) -> str:
        if not np.isfinite(value):
            return "NAN" if np.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
        return f"{np.float32(value)!s}f" if real == "float" else repr(value)

    return text
