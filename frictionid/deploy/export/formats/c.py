"""Friction as C99: a header and a source, no allocation, numbers in double or float."""

import numpy as np

from frictionid.deploy.export import expressions as ex

from ..exported import ExportedFriction, ExportSettings, Written

_CALLS = "sqrt exp log log1p tanh sin cos".split()


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """Source and header, with functions of arrays that have an entry for each joint."""
    real, functions = settings.precision, ex.functions(model)
    heads = {f.name: _head(f, len(model.joints), settings) for f in functions}
    language = _language(real)
    context = {"language": language, "functions": functions, "heads": heads, "comment": comment}
    templates = {".c": "source.c.j2", ".h": "header.h.j2"}
    files = {end: ex.rendered(name, model, settings, context) for end, name in templates.items()}
    note = f"compile with any C99 compiler and -lm; {'; '.join(heads.values())}"
    return Written(files, notes=(note,))


def _head(function: ex.Function, n: int, settings: ExportSettings) -> str:
    real, memory = settings.precision, f"{settings.name}_memory *memory"
    is_torque = function.name == "torque"
    types = {"memory": f"const {memory}" if is_torque else memory, "dt": f"{real} dt"}
    arguments = [types.get(x, f"const {real} {x}[{n}]") for x in function.arguments]
    arguments += {"torque": [f"{real} Tf[{n}]"], "start": [memory]}.get(function.name, [])
    return f"void {settings.name}_{function.name}({', '.join(arguments)})"


def comment(text: str) -> str:
    """Text within a comment, which it neither ends nor begins anew."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("?", ".")


def _language(real: str) -> ex.Language:
    """C; functions of floats end in f, and so do their constants, the shortest that are exact."""
    end = "f" if real == "float" else ""
    names = {name: name for name in _CALLS} | {"absolute": "fabs", "arctan": "atan", "power": "pow"}
    syntax: dict[str, str | ex.Form] = {
        **{operation: f"{name}{end}(" for operation, name in names.items()},
        "maximum": "max_of(",
        "minimum": "min_of(",
        "sign": "sign_of(",
        "and": "&&",
        "or": "||",
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
