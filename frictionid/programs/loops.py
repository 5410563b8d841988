"""Loops compiled to machine code by Numba, kept on disk where there is a folder for it.

What is kept holds the code of other files that a function calls, too: of its room, or of this one.
So it is compiled again when a file of these has changed since.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from pathlib import Path
from typing import Any

import numba

from frictionid.progress import report_compiling

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
        if not fast.signatures and not _indices(fast):
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
