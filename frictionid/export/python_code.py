"""Friction as a Python module without dependencies: plain numbers, `math` only."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain

from frictionid.export.exported import ExportedFriction
from frictionid.export.formats import ExportSettings, Written
from frictionid.export.program import Line, Operand, Program, Value

TEXTS: Mapping[str, str] = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "power": "{} ** {}",
    "negative": "-{}",
    "absolute": "abs({})",
    "sign": "float({0} > 0.0) - float({0} < 0.0)",
    "sqrt": "math.sqrt({})",
    "exp": "math.exp({})",
    "log": "math.log({})",
    "log1p": "math.log1p({})",
    "tanh": "math.tanh({})",
    "arctan": "math.atan({})",
    "sin": "math.sin({})",
    "cos": "math.cos({})",
    "maximum": "max({}, {})",
    "minimum": "min({}, {})",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "equal": "{} == {}",
    "and": "{} and {}",
    "or": "{} or {}",
    "not": "not {}",
    "select": "{1} if {0} else {2}",
}


def write(own: ExportedFriction, settings: ExportSettings) -> Written:
    """A module with `start`, `torque` and `advance`, on lists with an entry for each joint."""
    programs, n = own.programs, len(own.joints)
    inputs = ", ".join(programs.inputs)
    facts = "\n".join(own.facts)
    parts = [
        f'"""{settings.name}: torques of {n} part{"s" * (n > 1)} by {inputs or "nothing"}.\n\n'
        f'Lists have an entry for each of {", ".join(own.joints)}.\n\n{facts}\n"""\n\nimport math',
        f"JOINTS = {list(own.joints)!r}\nSPEEDS = {list(own.speeds)!r}",
    ]
    if programs.memory:
        time = own.law.sample_time
        when = "each step" if time is None else f"each {time:g} s"
        parts += [
            _function("start", programs.start, (*programs.inputs,), "Memory to begin with."),
            _function(
                "advance",
                programs.advance,
                (*programs.inputs, "memory", "dt"),
                f"Memory after dt [s]; to be called {when}.",
            ),
        ]
    arguments = (*programs.inputs, *(("memory",) if programs.memory else ()))
    parts.append(_function("torque", programs.torque, arguments, "Friction torques Tf."))
    return Written({".py": ("\n\n\n".join(parts) + "\n").encode()})


def _function(name: str, program: Program, arguments: tuple[str, ...], says: str) -> str:
    """Source of a function; memory is a list of entries, each with one number per joint."""
    lines = [f"def {name}({', '.join(arguments)}):", f'    """{says}"""']
    for k, own in enumerate(program.inputs):
        group, _, joint = own.rpartition("_")
        source = f"{group}[{int(joint) - 1}]"
        if group == "dt":
            source = "dt"
        elif group.startswith("memory_"):
            source = f"memory[{int(group.rpartition('_')[2]) - 1}][{int(joint) - 1}]"
        lines.append(f"    v{k} = {source}")
    lines += [f"    v{number} = {_text(line)}" for number, line in program.numbered()]
    entries = [f"[{', '.join(map(_operand, own))}]" for own in program.outputs.values()]
    joined = entries[0] if name == "torque" else f"[{', '.join(chain(entries))}]"
    return "\n".join([*lines, f"    return {joined}"])


def _text(line: Line) -> str:
    return TEXTS[line.operation].format(*map(_operand, line.operands))


def _operand(value: Operand) -> str:
    if isinstance(value, Value):
        return f"v{value.number}"
    return repr(float(value)) if value >= 0 else f"({float(value)!r})"
