"""Programs as machine code: functions that read and write numbers in memory.

All functions have one signature, so that loops which call them are compiled once, whatever they
compute.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numba

from frictionid.compiled import called, pointer
from frictionid.tracing.program import Operand, Program, Value

_NUMBERS = numba.types.CPointer(numba.types.float64)
SIGNATURE = numba.types.void(_NUMBERS, numba.types.int64, numba.types.int64)
_FORMS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "power": "{} ** {}",
    "negative": "-{}",
    "absolute": "abs({})",
    "sign": "(1.0 if {0} > 0.0 else -1.0 if {0} < 0.0 else 0.0)",
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
    "less": "(1.0 if {} < {} else 0.0)",
    "less_equal": "(1.0 if {} <= {} else 0.0)",
    "equal": "(1.0 if {} == {} else 0.0)",
    "and": "(1.0 if {} != 0.0 and {} != 0.0 else 0.0)",
    "or": "(1.0 if {} != 0.0 or {} != 0.0 else 0.0)",
    "not": "(1.0 if {} == 0.0 else 0.0)",
    "select": "({1} if {0} != 0.0 else {2})",
}


def machine_code(program: Program) -> Any:
    """Function f(numbers, first, out) of inputs in their order, outputs one behind the other.

    `numbers` is a place in memory, see `compiled.pointer`; inputs stand from entry `first` on,
    outputs from entry `out`.

    >>> import numpy as np
    >>> from frictionid.tracing.trace import traced
    >>> double = machine_code(traced(lambda x: {"y": 2.0 * x["w"]}, {"w": 2}))
    >>> run(double, numbers := np.array([1.0, 3.0, 0.0, 0.0]), 0, 2)
    >>> numbers[2:]
    array([2., 6.])
    """
    return _compiled(_source(program))


@lru_cache(maxsize=256)
def _compiled(source: str) -> Any:
    scope: dict[str, Any] = {"math": math}
    exec(compile(source, "<program>", "exec"), scope)
    return numba.cfunc(SIGNATURE, error_model="numpy")(scope["function"])


@called
def run(function: Any, numbers: Any, first: int, out: int) -> None:
    """Call machine code from Python, on an array."""
    function(pointer(numbers), first, out)


def _source(program: Program) -> str:
    lines = [f"    v{k} = x[first + {k}]" for k in range(len(program.inputs))]
    for k, line in program.numbered():
        lines.append(f"    v{k} = " + _FORMS[line.operation].format(*map(_text, line.operands)))
    outputs = [value for own in program.outputs.values() for value in own]
    lines += [f"    x[out + {k}] = {_text(value)}" for k, value in enumerate(outputs)]
    return "\n".join(["def function(x, first, out):", *lines]) + "\n"


def _text(operand: Operand) -> str:
    if isinstance(operand, Value):
        return f"v{operand.number}"
    known = {math.inf: "math.inf", -math.inf: "-math.inf"}
    return "math.nan" if math.isnan(operand) else known.get(operand, f"({operand!r})")
