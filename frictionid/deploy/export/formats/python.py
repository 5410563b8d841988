"""Friction as a Python module without dependencies: plain numbers, `math` only."""

from __future__ import annotations

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written

_MATH = ("sqrt", "log", "log1p", "tanh", "sin", "cos")
_SYNTAX: dict[str, str | ex.Form] = {
    **{name: f"math.{name}(" for name in _MATH},
    **{"exp": "exp(", "sign": "sign(", "absolute": "abs(", "arctan": "math.atan("},
    **{"power": "**", "maximum": "max(", "minimum": "min(", "number": "float("},
    **{"less": "<", "less_equal": "<=", "equal": "==", "and": "and", "or": "or"},
    "not": ex.Form("(not {})", ex.CALLED, (ex.BOTH,)),
    "select": ex.Form("{1} if {0} else {2}", ex.CHOSEN, (ex.EITHER,) * 3),
    "truth": ex.Form("{} != 0.0", ex.COMPARED, (ex.ADDED,)),
}
LANGUAGE = ex.Language(ex.forms(_SYNTAX), repr)
_HELPERS = {
    "exp(": "def exp(a):\n    return math.exp(a) if a < 709.0 else math.inf",
    "sign(": "def sign(a):\n    return float(a > 0.0) - float(a < 0.0)",
}
_RESULTS = {"start": "memory", "advance": "memory", "torque": "Tf"}


def write(model: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `start`, `torque` and `advance`, on lists with an entry for each joint."""
    facts, names = "\n".join(model.facts), ", ".join(model.joints)
    functions = ex.functions(model)
    sources = [_source(function, model) for function in functions]
    parts = [
        f'"""{settings.name}: friction of {len(model.joints)} parts.\n\n'
        f"Lists have an entry for each of {_quoted(names)}.\n\n"
        f'{_quoted(facts)}\n"""\n\nimport math',
        f"JOINTS = {list(model.joints)!r}\nSPEEDS = {list(model.speeds)!r}",
        *(text for use, text in _HELPERS.items() if any(use in s for s in sources)),
        *sources,
    ]
    calls = [f"{_RESULTS[f.name]} = {f.name}({', '.join(f.arguments)})" for f in functions]
    note = f"from {settings.stem} import *; {'; '.join(calls)}"
    return Written({".py": ("\n\n\n".join(parts) + "\n").encode()}, notes=(note,))


def _quoted(text: str) -> str:
    """Text within a docstring, which it cannot end."""
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _source(function: ex.Function, model: ExportedFriction) -> str:
    """Source of a function; memory is a list of entries, each with one number per joint."""
    code = ex.blocks(function.program)
    lines = [f"def {function.name}({', '.join(function.arguments)}):", f'    """{function.says}"""']
    lines += [f"    {name} = {LANGUAGE.place(name)}" for name in function.reads(code)]
    for joint, block in enumerate(code):
        lines.append(f"    # {model.joints[joint]}")
        for target, text, kind in LANGUAGE.lines(block, joint):
            lines.append(_assigned(_new(target) if kind == "output" else target, text))
    entries = [
        f"[{', '.join(f'{_new(output)}_{j + 1}' for j in range(len(code)))}]"
        for output in function.program.outputs
    ]
    result = entries[0] if function.name == "torque" else f"[{', '.join(entries)}]"
    return "\n".join([*lines, f"    return {result}"])


def _new(output: str) -> str:
    """Name of an output, which is not that of an input."""
    return output.replace("memory", "new")


def _assigned(name: str, text: str) -> str:
    if len(text) < ex.WIDTH - 20:
        return f"    {name} = {text}"
    return f"    {name} = (\n{ex.folded(text, 2 * '    ')}\n    )"
