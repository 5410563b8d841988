"""Friction as a Python module without dependencies: plain numbers, `math` only."""

from __future__ import annotations

from collections.abc import Mapping

from frictionid.deploy.export import expressions as ex
from frictionid.deploy.export.exported import ExportedFriction, ExportSettings, Written
from frictionid.deploy.export.expressions import Element, Function, functions, signatures

FORMS: Mapping[str, ex.Form] = {
    **ex.SUMS,
    **{name: ex.call(name) for name in ("exp", "sign")},
    **{name: ex.call(f"math.{name}") for name in ("sqrt", "log", "log1p", "tanh", "sin", "cos")},
    "absolute": ex.call("abs"),
    "arctan": ex.call("math.atan"),
    "power": ex.infix("**", ex.POWER),
    "maximum": ex.call("max", 2),
    "minimum": ex.call("min", 2),
    "less": ex.infix("<", ex.COMPARED),
    "less_equal": ex.infix("<=", ex.COMPARED),
    "equal": ex.infix("==", ex.COMPARED),
    "and": ex.infix("and", ex.BOTH),
    "or": ex.infix("or", ex.EITHER),
    "not": ex.Form("(not {})", ex.CALLED, (ex.BOTH,)),
    "select": ex.Form("{1} if {0} else {2}", ex.CHOSEN, (ex.EITHER,) * 3),
    "number": ex.call("float"),
    "truth": ex.Form("{} != 0.0", ex.COMPARED, (ex.ADDED,)),
}
_HELPERS = {
    "exp(": "def exp(a):\n    return math.exp(a) if a < 709.0 else math.inf",
    "sign(": "def sign(a):\n    return float(a > 0.0) - float(a < 0.0)",
}


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `start`, `torque` and `advance`, on lists with an entry for each joint."""
    n, facts, names = len(own.joints), "\n".join(own.facts), ", ".join(own.joints)
    sources = [_source(function, own) for function in functions(own)]
    parts = [
        f'"""{settings.name}: friction of {n} parts.\n\n'
        f"Lists have an entry for each of {_quoted(names)}.\n\n"
        f'{_quoted(facts)}\n"""\n\nimport math',
        f"JOINTS = {list(own.joints)!r}\nSPEEDS = {list(own.speeds)!r}",
        *(text for use, text in _HELPERS.items() if any(use in s for s in sources)),
        *sources,
    ]
    note = f"from {settings.stem} import *; {signatures(own)}"
    return Written({".py": ("\n\n\n".join(parts) + "\n").encode()}, notes=(note,))


def _quoted(text: str) -> str:
    """Text within a docstring, which it cannot end."""
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _source(function: Function, own: ExportedFriction) -> str:
    """Source of a function; memory is a list of entries, each with one number per joint."""
    code = function.code
    lines = [f"def {function.name}({', '.join(function.arguments)}):", f'    """{function.says}"""']
    lines += [f"    {name} = {_at(element)}" for name, element in function.read(code).items()]
    for joint, (block, name) in enumerate(zip(code, own.joints, strict=False)):
        lines.append(f"    # {name}")
        lines += [_assigned(s.name, s.expression) for s in block.statements]
        for output, value in block.outputs.items():
            lines.append(_assigned(f"{_new(output)}_{joint + 1}", value))
    entries = [
        f"[{', '.join(f'{_new(output)}_{j + 1}' for j in range(len(code)))}]"
        for output in function.program.outputs
    ]
    made = entries[0] if function.name == "torque" else f"[{', '.join(entries)}]"
    return "\n".join([*lines, f"    return {made}"])


def _new(output: str) -> str:
    """Name of an output, which is not that of an input."""
    return output.replace("memory", "new")


def _at(element: Element) -> str:
    if element.argument == "dt":
        return "dt"
    entry = f"[{element.entry}]" if element.argument == "memory" else ""
    return f"{element.argument}{entry}[{element.joint}]"


def _assigned(name: str, value: ex.Expression) -> str:
    line = ex.text(value, FORMS, repr)
    if len(line) < ex.WIDTH - 20:
        return f"    {name} = {line}"
    return f"    {name} = (\n{ex.folded(line, 2 * '    ')}\n    )"
