"""Loops compiled to machine code by Numba, kept on disk where there is a folder for it.

Numba compiles a function again when its own file changes; functions of other files that it calls
are part of the kept code. So what is shared between files should be small and final.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numba

inlined = numba.njit(error_model="numpy", forceinline=True)  # for functions that compiled ones call


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function as machine code, which is kept where there is a folder that can be written.

    >>> compiled(lambda x: 2.0 * x)(1.5)
    3.0
    """
    try:
        fast = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # no such folder
        fast = inlined(function)

    @wraps(function)
    def call(*arguments: Any) -> Any:
        try:
            return fast(*arguments)
        except OSError:  # a full disk: it is compiled by now, but could not be kept
            return fast(*arguments)

    return call
