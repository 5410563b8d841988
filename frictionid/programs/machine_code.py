"""Machine code: loops of scalars by Numba, kept on disk, and programs by LLVM.

What is kept of a loop holds the code of other files that it calls, too: of its room, or of this
one. So it is compiled again when a file of these has changed since.

Programs become functions that read and write the numbers of a row in memory. Loops that call them
by their address are compiled once, whatever they compute. A program is straight-line code already:
it is handed to LLVM as it is, in a tenth of the time that Numba takes for the same lines of Python.
A row is one array, which costs nothing to hand on.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache, wraps
from itertools import count
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from llvmlite.binding import parse_assembly
from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from frictionid.progress import report_compiling

from .program import Operand, Program, Value

# for functions that compiled ones call: small ones, and larger ones
inlined = numba.njit(error_model="numpy", forceinline=True)
called = numba.njit(error_model="numpy")


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function as machine code, which is kept where there is a folder that can be written.

    >>> compiled(lambda x: 2.0 * x)(1.5)
    3.0
    """
    fast = kept(function)

    @wraps(function)
    def call(*arguments: Any) -> Any:
        if not fast.overloads and not _indices(fast):
            report_compiling(function.__name__.strip("_").replace("_", " "))
        try:
            return fast(*arguments)
        except OSError:  # a full disk: it is compiled by now, but could not be kept
            return fast(*arguments)

    return call


def kept(function: Callable[..., Any]) -> Any:
    """Compiled functions that others call, too long to be compiled for each of them."""
    try:
        fast = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # no such folder
        return called(function)
    _forget_outdated(fast)
    return fast


def _forget_outdated(fast: Any) -> None:
    """Remove what was kept before a file of its room changed."""
    changed = _newest_source(room_of(fast.py_func))
    for index in _indices(fast):
        with suppress(OSError):  # another process was faster
            if index.stat().st_mtime <= changed:
                index.unlink()


def _indices(fast: Any) -> list[Path]:
    """Files that say what is kept of a function; none where it has to be compiled."""
    if fast.stats.cache_path is None:
        return []
    name = f"{Path(fast.py_func.__code__.co_filename).stem}.{fast.py_func.__qualname__}-*.nbi"
    return list(Path(fast.stats.cache_path).glob(name.replace("<", "[<]")))


def room_of(function: Callable[..., Any]) -> str:
    """The folder of the package that a function stands in; empty for one from elsewhere."""
    return function.__module__.partition(".")[2].partition(".")[0]


@cache
def _newest_source(room: str) -> float:
    """When a file of a room, or of this one, changed last."""
    here = Path(__file__).parent
    files = [*here.rglob("*.py"), *(here.parent / room).rglob("*.py")]
    return max(path.stat().st_mtime for path in files)


# --- Programs -------------------------------------------------------------------------------------

_NUMBER, _INDEX = ir.DoubleType(), ir.IntType(64)
_FUNCTION = ir.FunctionType(ir.VoidType(), [ir.PointerType(_NUMBER)])
_ARITHMETIC = {"add": "fadd", "subtract": "fsub", "multiply": "fmul", "divide": "fdiv"}
_ALIKE = ("sqrt", "exp", "log", "sin", "cos")
_INTRINSIC = {"power": "pow", "absolute": "fabs"} | {x: x for x in _ALIKE}
_LIBRARY = {"log1p": "log1p", "tanh": "tanh", "arctan": "atan"}
_COMPARISON = {"less": "<", "less_equal": "<=", "equal": "=="}
_LONG = 50  # lines
_numbers = count()
_NAME = "frictionid"  # of a module, until it is compiled


def machine_code(
    programs: Mapping[str, Program],
    places: Mapping[str, int],
    sequences: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, int]:
    """Addresses, for `run_at`, of the programs and of `sequences` that run some of them in order.

    places : where the first entry of an input or an output, x_1 of x, stands in a row

    >>> import numpy as np
    >>> from frictionid.programs.trace import traced
    >>> double = traced(lambda x: {"y": 2.0 * x["w"]}, {"w": 2})
    >>> row = np.array([1.0, 3.0, 0.0, 0.0])
    >>> run(machine_code({"double": double}, {"w": 0, "y": 2})["double"], row)
    >>> row[2:]
    array([2., 6.])
    """
    module = ir.Module(_NAME)
    names = (*programs, *(sequences or {}))
    functions = {x: ir.Function(module, _FUNCTION, f"{_NAME}_{x}") for x in names}
    for name, program in programs.items():
        if len(program.lines) > _LONG:  # not to be compiled again in each sequence
            functions[name].attributes.add("noinline")
        _write(functions[name], program, places)
    for name, parts in (sequences or {}).items():
        builder = ir.IRBuilder(functions[name].append_basic_block())
        for part in parts:
            builder.call(functions[part], functions[name].args)
        builder.ret_void()
    library = _library(str(module))
    pointer = library.get_pointer_to_function
    return {x: int(pointer(f.name.replace(_NAME, library.name))) for x, f in functions.items()}


@cache  # code lives as long as the process: who knows its address, no one counts
def _library(text: str) -> Any:
    """The compiled module: machines that differ in their parameters alone share their code."""
    with global_compiler_lock:
        library = cpu_target.target_context.codegen().create_library(f"{_NAME}_{next(_numbers)}")
        library.add_llvm_module(parse_assembly(text.replace(_NAME, library.name)))
        library.finalize()
        return library


@intrinsic
def run_at(_: Any, __: Any, row: Any) -> Any:
    """Run the function f(row) that stands at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[1])(context, builder, arguments[1]).data
        builder.call(builder.inttoptr(arguments[0], _FUNCTION.as_pointer()), [data])
        return context.get_dummy_value()

    return types.void(types.int64, row), generate


@called
def run(function: int, row: Any) -> None:
    """Run machine code from Python, on the numbers of a row."""
    run_at(function, row)


def _write(function: ir.Function, program: Program, places: Mapping[str, int]) -> None:
    """Write a function that computes a program on the numbers of a row."""
    builder = ir.IRBuilder(function.append_basic_block())
    values: dict[int, Any] = {}

    def place(number: int) -> Any:
        return builder.gep(function.args[0], [ir.Constant(_INDEX, number)])

    def value(operand: Operand) -> Any:
        if not isinstance(operand, Value):
            return ir.Constant(_NUMBER, operand)
        if operand.number not in values:
            name, _, entry = program.inputs[operand.number].rpartition("_")
            values[operand.number] = builder.load(place(places[name] + int(entry) - 1))
        return values[operand.number]

    for number, (operation, operands) in program.numbered():
        values[number] = _built(builder, operation, *map(value, operands))
    # all are read before one is written: an output may be an input, too
    results = [
        (places[x] + k, value(v)) for x, row in program.outputs.items() for k, v in enumerate(row)
    ]
    for number, result in results:
        builder.store(result, place(number))
    builder.ret_void()


def _built(builder: ir.IRBuilder, operation: str, *operands: Any) -> Any:
    """Value of an operation."""
    yes, no = ir.Constant(_NUMBER, 1.0), ir.Constant(_NUMBER, 0.0)

    def truth(value: Any) -> Any:
        return builder.fcmp_unordered("!=", value, no)

    def number(truth: Any) -> Any:
        return builder.select(truth, yes, no)

    def ordered(how: str, a: Any, b: Any) -> Any:
        return builder.fcmp_ordered(how, a, b)

    if operation in _ARITHMETIC:
        return getattr(builder, _ARITHMETIC[operation])(*operands)
    if operation in _INTRINSIC:
        function = builder.module.declare_intrinsic(f"llvm.{_INTRINSIC[operation]}", [_NUMBER])
        return builder.call(function, operands)
    if operation in _LIBRARY:
        return builder.call(_external(builder.module, _LIBRARY[operation]), operands)
    if operation in _COMPARISON:
        return number(ordered(_COMPARISON[operation], *operands))
    others: dict[str, Callable[..., Any]] = {
        "negative": builder.fneg,
        "sign": lambda a: builder.fsub(number(ordered(">", a, no)), number(ordered("<", a, no))),
        "maximum": lambda a, b: builder.select(ordered(">", b, a), b, a),
        "minimum": lambda a, b: builder.select(ordered("<", b, a), b, a),
        "and": lambda a, b: number(builder.and_(truth(a), truth(b))),
        "or": lambda a, b: number(builder.or_(truth(a), truth(b))),
        "not": lambda a: builder.select(truth(a), no, yes),
        "select": lambda a, b, c: builder.select(truth(a), b, c),
    }
    return others[operation](*operands)


def _external(module: ir.Module, name: str) -> ir.Function:
    """A function of the mathematical library."""
    if name in module.globals:
        return module.globals[name]
    function = ir.Function(module, ir.FunctionType(_NUMBER, [_NUMBER]), name)
    function.attributes.add("nounwind")
    return function
