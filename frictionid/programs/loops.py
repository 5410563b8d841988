"""Loops compiled to machine code by Numba, kept on disk where there is a folder for it.

What is kept holds the code of other files that a function calls, too: of its room, or of this one.
So it is compiled again when a file of these has changed since.

Loops become programs, too: they compute once on numbers that write down what is done. Of what they
do not know yet, entries are `Number`s: they stand in arrays of objects, on which the Python that is
compiled otherwise runs as it is.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import cache, partialmethod, wraps
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np

from frictionid.arrays import Array
from frictionid.progress import report_compiling

from .program import Operand, Value
from .trace import Recorder, as_traced, recorder_of

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
    """The same for functions that compiled ones call, too long to be compiled for each of them."""
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


# --- Loops as programs ----------------------------------------------------------------------------


class Number:
    """A number of a program that is being written; with numbers that are known it gives another."""

    __slots__ = ("operand", "recorder")

    def __init__(self, recorder: Recorder, operand: Operand) -> None:
        self.recorder, self.operand = recorder, operand

    def _record(self, operation: str, *others: Any) -> Any:
        operands = (x.operand if isinstance(x, Number) else float(x) for x in (self, *others))
        result = self.recorder.record(operation, *operands)
        return Number(self.recorder, result) if isinstance(result, Value) else result

    def _record_behind(self, operation: str, other: Any) -> Any:
        return Number(self.recorder, float(other))._record(operation, self)

    __add__ = partialmethod(_record, "add")
    __radd__ = partialmethod(_record_behind, "add")
    __sub__ = partialmethod(_record, "subtract")
    __rsub__ = partialmethod(_record_behind, "subtract")
    __mul__ = partialmethod(_record, "multiply")
    __rmul__ = partialmethod(_record_behind, "multiply")
    __truediv__ = partialmethod(_record, "divide")
    __neg__ = partialmethod(_record, "negative")
    sin = partialmethod(_record, "sin")  # NumPy asks an entry for them
    cos = partialmethod(_record, "cos")


def traced_loop(
    loop: Callable[..., object], geometry: Any, shapes: tuple[tuple[int, ...], ...], *arrays: Array
) -> list[Any]:
    """Traced arrays of these shapes that a loop over samples fills at one sample.

    loop : called with the geometry, arrays (1, ...), and arrays of results (1, ...)
    arrays : those that are not traced are constants
    """
    recorder = recorder_of(arrays)

    def number(operand: Any) -> Any:
        return Number(recorder, operand) if isinstance(operand, Value) else float(operand)

    def operand(number: Any) -> Operand:
        return number.operand if isinstance(number, Number) else float(number)

    numbers = [np.frompyfunc(number, 1, 1)(np.asarray(x))[None] for x in arrays]
    out = [np.empty((1, *shape), dtype=object) for shape in shapes]
    interpreted(loop)(geometry, *numbers, *out)
    return [as_traced(recorder, np.frompyfunc(operand, 1, 1)(x[0])) for x in out]


@cache
def interpreted(loop: Any) -> Any:
    """The Python function that was compiled, which calls Python functions in its turn."""
    function = getattr(loop, "__wrapped__", loop)
    function = getattr(function, "py_func", function)
    scope = dict(function.__globals__)
    compiled = (name for name in function.__code__.co_names if hasattr(scope.get(name), "py_func"))
    scope |= {name: interpreted(scope[name]) for name in tuple(compiled)}
    return FunctionType(function.__code__, scope, function.__name__, function.__defaults__)
