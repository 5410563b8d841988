"""The cost of a network as code that PyTorch compiles; what that needs, and what to do without."""

from __future__ import annotations

import os
import shutil
import sys
import warnings
from collections.abc import Callable
from typing import Any

from frictionid.errors import InputError

_USUAL = {"darwin": "clang++", "win32": "cl"}  # what PyTorch calls where CXX names nothing else


def compiler() -> str:
    """Path of the C++ compiler that PyTorch calls, by CXX or the usual one; "" where none is."""
    return shutil.which(os.environ.get("CXX") or _USUAL.get(sys.platform, "g++")) or ""


def check_compiler() -> None:
    """Refuse to compile where there is no C++ compiler.

    Raises
    ------
    InputError
        Saying what to do.
    """
    if not compiler():
        name = os.environ.get("CXX") or _USUAL.get(sys.platform, "g++")
        raise InputError(
            f"compile = true: PyTorch needs a C++ compiler, and {name!r} is not found: leave "
            "compile out, or install one (CXX names another)"
        )


def compiled(cost: Callable[..., Any]) -> Callable[..., Any]:
    """A function of tensors, compiled when it is first called.

    Raises
    ------
    InputError
        In that call, where PyTorch cannot compile it.
    """
    import torch

    made: list[Callable[..., Any]] = []

    def first(*tensors: Any) -> Any:
        if made:
            return made[0](*tensors)
        try:
            # it tells at length what it sees of the libraries below
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                fast: Callable[..., Any] = torch.compile(cost)
                found = fast(*tensors)
        except Exception as error:  # whatever its compilers raise
            words = str(error).strip().splitlines() or [type(error).__name__]
            raise InputError(
                f"compile = true: PyTorch cannot compile this network ({words[0]}): leave compile "
                "out"
            ) from None
        made.append(fast)
        return found

    return first
