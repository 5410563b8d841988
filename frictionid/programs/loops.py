"""Loops compiled to machine code by Numba, kept on disk where there is a folder for it.

What is kept holds the code of other files that a function calls, too: of its room, or of this one.
So it is compiled again when a file of these has changed since.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from pathlib import Path
from typing import Any

import numba
from llvmlite import ir
from numba.extending import intrinsic

# for functions that compiled ones call: small ones, and larger ones
inlined = numba.njit(error_model="numpy", forceinline=True)
called = numba.njit(error_model="numpy")

Numbers = Any  # where numbers begin in memory, see `pointer`


@intrinsic
def pointer(_: Any, array: Any) -> Any:
    """Where the numbers of a contiguous array begin, for compiled loops.

    Arrays count who knows them, whenever they are handed on; that costs more than short loops do.
    The array must live on: something must be done to it after the last use of the place.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return numba.types.CPointer(array.dtype)(array), generate


@intrinsic
def run_at(_: Any, address: Any, numbers: Any, first: Any, out: Any) -> Any:
    """Run the function f(numbers, first, out) that stands at an address."""
    whole = numba.types.int64
    kinds = [kind if kind is numbers else whole for kind in (address, numbers, first, out)]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in signature.args[1:]]
        function = ir.FunctionType(ir.VoidType(), kinds)
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return numba.types.void(*kinds), generate


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function as machine code, which is kept where there is a folder that can be written.

    >>> compiled(lambda x: 2.0 * x)(1.5)
    3.0
    """
    fast = kept(function)

    @wraps(function)
    def call(*arguments: Any) -> Any:
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
    code = fast.py_func.__code__
    changed = _newest_source(room_of(fast.py_func))
    name = f"{Path(code.co_filename).stem}.{fast.py_func.__qualname__}-*.nbi"
    for index in Path(fast.stats.cache_path).glob(name.replace("<", "[<]")):
        with suppress(OSError):  # another process was faster
            if index.stat().st_mtime <= changed:
                index.unlink()


def room_of(function: Callable[..., Any]) -> str:
    """The folder of the package that a function stands in; empty for one from elsewhere."""
    return function.__module__.partition(".")[2].partition(".")[0]


@cache
def _newest_source(room: str) -> float:
    """When a file of a room, or of this one, changed last."""
    here = Path(__file__).parent
    files = [*here.rglob("*.py"), *(here.parent / room).rglob("*.py")]
    return max(path.stat().st_mtime for path in files)
