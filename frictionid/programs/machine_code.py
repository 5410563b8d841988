"""Programs as machine code: functions that read and write numbers in memory.

All functions have one signature and are called by their address, so that loops which call them are
compiled once, whatever they compute. A program is straight-line code already: it is handed to LLVM
as it is, in a tenth of the time that Numba takes for the same lines of Python.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import count
from typing import Any

from llvmlite import ir
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target

from frictionid.programs.loops import called, pointer, run_at
from frictionid.programs.program import Line, Operand, Program, Value

_NUMBER, _INDEX = ir.DoubleType(), ir.IntType(64)
_FUNCTION = ir.FunctionType(ir.VoidType(), [ir.PointerType(_NUMBER), _INDEX, _INDEX])
_ARITHMETIC = {"add": "fadd", "subtract": "fsub", "multiply": "fmul", "divide": "fdiv"}
_INTRINSIC = {"power": "pow", "absolute": "fabs"} | {x: x for x in ("sqrt", "exp", "log")}
_INTRINSIC |= {x: x for x in ("sin", "cos")}
_LIBRARY = {"log1p": "log1p", "tanh": "tanh", "arctan": "atan"}
_COMPARISON = {"less": "<", "less_equal": "<=", "equal": "=="}
_numbers = count()
_kept: list[Any] = []  # code lives as long as the process: who knows its address, no one counts


def machine_code(program: Program) -> int:
    """Address of a function f(numbers, first, out) of inputs in their order, for `run_at`.

    `numbers` is a place in memory, see `compiled.pointer`; inputs stand from entry `first` on,
    outputs from entry `out`, one behind the other.

    >>> import numpy as np
    >>> from frictionid.programs.trace import traced
    >>> double = machine_code(traced(lambda x: {"y": 2.0 * x["w"]}, {"w": 2}))
    >>> run(double, numbers := np.array([1.0, 3.0, 0.0, 0.0]), 0, 2)
    >>> numbers[2:]
    array([2., 6.])
    """
    outputs = tuple(value for own in program.outputs.values() for value in own)
    return _compiled(len(program.inputs), program.lines, outputs)


@called
def run(function: int, numbers: Any, first: int, out: int) -> None:
    """Run machine code from Python, on an array."""
    run_at(function, pointer(numbers), first, out)


@cache
def _compiled(inputs: int, lines: tuple[Line, ...], outputs: tuple[Operand, ...]) -> int:
    name = f"frictionid_program_{next(_numbers)}"
    module = ir.Module(name)
    function = ir.Function(module, _FUNCTION, name)
    builder = ir.IRBuilder(function.append_basic_block())
    numbers, first, out = function.args

    def place(start: Any, k: int) -> Any:
        return builder.gep(numbers, [builder.add(start, ir.Constant(_INDEX, k))])

    values = [builder.load(place(first, k)) for k in range(inputs)]

    def value(operand: Operand) -> Any:
        if isinstance(operand, Value):
            return values[operand.number]
        return ir.Constant(_NUMBER, operand)

    for operation, operands in lines:
        values.append(_built(builder, operation, *map(value, operands)))
    for k, operand in enumerate(outputs):
        builder.store(value(operand), place(out, k))
    builder.ret_void()
    return _finished(module, name)


def _finished(module: ir.Module, name: str) -> int:
    """Address of a function of a module."""
    with global_compiler_lock:
        library = cpu_target.target_context.codegen().create_library(name)
        library.add_ir_module(module)
        library.finalize()
        _kept.append(library)
        return int(library.get_pointer_to_function(name))


def _built(builder: ir.IRBuilder, operation: str, *own: Any) -> Any:
    """Value of an operation."""
    one, zero = ir.Constant(_NUMBER, 1.0), ir.Constant(_NUMBER, 0.0)

    def truth(value: Any) -> Any:
        return builder.fcmp_unordered("!=", value, zero)

    def number(truth: Any) -> Any:
        return builder.select(truth, one, zero)

    def ordered(how: str, a: Any, b: Any) -> Any:
        return builder.fcmp_ordered(how, a, b)

    if operation in _ARITHMETIC:
        return getattr(builder, _ARITHMETIC[operation])(*own)
    if operation in _INTRINSIC:
        function = builder.module.declare_intrinsic(f"llvm.{_INTRINSIC[operation]}", [_NUMBER])
        return builder.call(function, own)
    if operation in _LIBRARY:
        return builder.call(_external(builder.module, _LIBRARY[operation]), own)
    if operation in _COMPARISON:
        return number(ordered(_COMPARISON[operation], *own))
    others: dict[str, Callable[..., Any]] = {
        "negative": builder.fneg,
        "sign": lambda a: builder.fsub(
            number(ordered(">", a, zero)), number(ordered("<", a, zero))
        ),
        "maximum": lambda a, b: builder.select(ordered(">", b, a), b, a),
        "minimum": lambda a, b: builder.select(ordered("<", b, a), b, a),
        "and": lambda a, b: number(builder.and_(truth(a), truth(b))),
        "or": lambda a, b: number(builder.or_(truth(a), truth(b))),
        "not": lambda a: builder.select(truth(a), zero, one),
        "select": lambda a, b, c: builder.select(truth(a), b, c),
    }
    return others[operation](*own)


def _external(module: ir.Module, name: str) -> ir.Function:
    """A function of the mathematical library."""
    if name in module.globals:
        return module.globals[name]
    function = ir.Function(module, ir.FunctionType(_NUMBER, [_NUMBER]), name)
    function.attributes.add("nounwind")
    return function
