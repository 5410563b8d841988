"""Friction as a Python module without dependencies: plain numbers, `math` only."""

from frictionid.deploy.export import expressions as ex

from ..exported import ExportedFriction, ExportSettings, Written

_MATH = "sqrt log log1p tanh sin cos".split()
_SYNTAX: dict[str, str | ex.Form] = {
    **{name: f"math.{name}(" for name in _MATH},
    "exp": "exp(",
    "sign": "sign(",
    "absolute": "abs(",
    "arctan": "math.atan(",
    "power": "**",
    "maximum": "max(",
    "minimum": "min(",
    "number": "float(",
    "and": "and",
    "or": "or",
    "not": ex.Form("(not {})", ex.CALLED, (ex.BOTH,)),
    "select": ex.Form("{1} if {0} else {2}", ex.CHOSEN, (ex.EITHER,) * 3),
    "truth": ex.Form("{} != 0.0", ex.COMPARED, (ex.ADDED,)),
}
LANGUAGE = ex.Language(ex.forms(_SYNTAX), repr)
_RESULTS = {"start": "memory", "advance": "memory", "torque": "Tf"}


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `start`, `torque` and `advance`, on lists with an entry for each joint."""
    functions = ex.functions(model)
    context = {"language": LANGUAGE, "functions": functions, "quoted": _quoted}
    calls = [f"{_RESULTS[f.name]} = {f.name}({', '.join(f.arguments)})" for f in functions]
    note = f"from {settings.stem} import *; {'; '.join(calls)}"
    return Written({".py": ex.rendered("module.py.j2", model, settings, context)}, notes=(note,))


def _quoted(text: str) -> str:
    """Text within a docstring, which it cannot end."""
    return text.replace("\\", "\\\\").replace('"', '\\"')
