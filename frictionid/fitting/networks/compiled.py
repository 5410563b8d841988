"""The cost of a network as code that PyTorch compiles, with a C++ compiler."""

from __future__ import annotations

import os
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from frictionid.errors import InputError, needs

_DEFAULT = {"darwin": "clang++", "win32": "cl"}  # what PyTorch calls where CXX names no other


def compiler() -> str:
    """Path of the C++ compiler that PyTorch calls, which CXX may name; "" if there is none."""
    return shutil.which(_name()) or ""


def _name() -> str:
    return os.environ.get("CXX") or _DEFAULT.get(sys.platform, "g++")


def check_compiler() -> None:
    """Refuse to compile where there is no C++ compiler.

    Raises
    ------
    InputError
        Saying what to do.
    """
    if not compiler():
        raise InputError(
            f"compile = true: PyTorch needs a C++ compiler, and {_name()!r} is not found: leave "
            "compile out, or install one (CXX names another)"
        )


def compiled(cost: Callable[..., Any]) -> Callable[..., Any]:
    """The cost as a function of tensors that is compiled when it is first called.

    Raises
    ------
    InputError
        In that call, where PyTorch cannot compile it.
    """
    with needs("networks"):
        import torch

    with _without_warnings():
        fast: Callable[..., Any] = torch.compile(cost)

    def compiled_cost(*tensors: Any) -> Any:
        try:
            with _without_warnings():
                return fast(*tensors)
        except Exception as error:  # whatever its compilers raise
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
            raise InputError(
                f"compile = true: PyTorch cannot compile this network ({reason}): leave compile out"
            ) from None

    return compiled_cost


@contextmanager
def _without_warnings() -> Iterator[None]:
    """PyTorch warns at length about the libraries that its compilers see."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
