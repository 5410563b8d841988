"""Friction as C99: a header and a source, no allocation, numbers in double or float."""

from __future__ import annotations

import numpy as np

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written

_CALLS = ("sqrt", "exp", "log", "log1p", "tanh", "sin", "cos")
# which compilers put in place; fmax and fmin would be calls
_HELPERS = {
    ("max_of", ("a", "b")): "a > b ? a : b",
    ("min_of", ("a", "b")): "a < b ? a : b",
    ("sign_of", ("a",)): "({real})((a > 0) - (a < 0))",
}


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """Source and header, with functions of arrays that have an entry for each joint."""
    functions = ex.functions(model)
    heads = [_head(function, len(model.joints), settings) for function in functions]
    header = _header(model, settings, [f.says for f in functions], heads)
    language = _language(settings.precision)
    bodies = [
        f"{head}\n{{\n{_body(f, model, language, settings.precision)}\n}}"
        for f, head in zip(functions, heads, strict=True)
    ]
    note = f"compile with any C99 compiler and -lm; {'; '.join(heads)}"
    files = {".c": _source(bodies, settings).encode(), ".h": header.encode()}
    return Written(files, notes=(note,))


def _header(
    model: ExportedFriction, settings: ExportSettings, says: list[str], heads: list[str]
) -> str:
    """Facts, types and declarations."""
    big, n, entries = settings.name.upper(), len(model.joints), model.programs.memory
    about = "\n".join(f" * {_comment(line)}" for line in model.facts)
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
    parts += [f"/* {text} */\n{head};" for text, head in zip(says, heads, strict=True)]
    parts += ["#ifdef __cplusplus\n}\n#endif", f"#endif /* {big}_H */"]
    return "\n\n".join(parts) + "\n"


def _source(bodies: list[str], settings: ExportSettings) -> str:
    """Definitions of what the header declares."""
    real = settings.precision
    parts = [f'#include "{settings.stem}.h"\n\n#include <math.h>']
    for (name, arguments), value in _HELPERS.items():
        if any(f"{name}(" in body for body in bodies):
            declared = ", ".join(f"{real} {x}" for x in arguments)
            result = value.format(real=real)
            parts.append(f"static {real} {name}({declared})\n{{\n    return {result};\n}}")
    return "\n\n".join([*parts, *bodies]) + "\n"


def _head(function: ex.Function, n: int, settings: ExportSettings) -> str:
    real, memory = settings.precision, f"{settings.name}_memory *memory"
    is_torque = function.name == "torque"
    types = {"memory": f"const {memory}" if is_torque else memory, "dt": f"{real} dt"}
    arguments = [types.get(x, f"const {real} {x}[{n}]") for x in function.arguments]
    arguments += {"torque": [f"{real} Tf[{n}]"], "start": [memory]}.get(function.name, [])
    return f"void {settings.name}_{function.name}({', '.join(arguments)})"


def _body(function: ex.Function, model: ExportedFriction, language: ex.Language, real: str) -> str:
    """All inputs are read first, so that memory can be written over."""
    code = ex.blocks(function.program)
    names = function.reads(code)
    # memory is written to by other functions than that of the torques
    arguments = {name.partition("_")[0] for name in names}
    written = set() if function.name == "torque" else {"memory"}
    lines = [f"    (void){x};" for x in function.arguments if x not in arguments | written]
    lines += [f"    const {real} {name} = {language.place(name)};" for name in names]
    for joint, block in enumerate(code):
        lines.append(f"\n    /* {_comment(model.joints[joint])} */")
        for target, text, kind in language.lines(block, joint):
            types = {"truth": f"const int {target}", "number": f"const {real} {target}"}
            lines.append(ex.folded(f"{types.get(kind) or language.place(target)} = {text};"))
    return "\n".join(lines)


def _comment(text: str) -> str:
    """Text within a comment, which it neither ends nor begins anew."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("?", ".")


def _language(real: str) -> ex.Language:
    """C; functions of floats end in f, and so do their constants, the shortest that are exact."""
    end = "f" if real == "float" else ""
    names = {name: name for name in _CALLS} | {"absolute": "fabs", "arctan": "atan", "power": "pow"}
    syntax: dict[str, str | ex.Form] = {
        **{operation: f"{name}{end}(" for operation, name in names.items()},
        **{"maximum": "max_of(", "minimum": "min_of(", "sign": "sign_of("},
        **{"less": "<", "less_equal": "<=", "equal": "==", "and": "&&", "or": "||"},
        "not": ex.Form("!{}", ex.CALLED, (ex.CALLED,)),
        "select": ex.Form("{} ? {} : {}", ex.CHOSEN, (ex.EITHER,) * 3),
        "number": ex.Form(f"({real}){{}}", ex.CALLED, (ex.CALLED,)),
        "truth": ex.Form("{} != 0", ex.EQUAL, (ex.COMPARED,)),
    }

    def number(value: float) -> str:
        if not np.isfinite(value):
            return "NAN" if np.isnan(value) else "INFINITY" if value > 0 else "-INFINITY"
        return f"{np.float32(value)!s}f" if end else repr(value)

    return ex.Language(ex.forms(syntax), number, "memory->entry[{}][{}]")
