"""Symbolic expressions compiled to flat scalar code that runs on NumPy and torch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from frictionid.arrays import Array


class _Printer(StrPrinter):
    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802 (SymPy's name)
        return repr(float(expr))


def scalar_code(
    arguments: Sequence[sp.Symbol], outputs: Sequence[sp.Expr]
) -> Callable[..., tuple[Array, ...]]:
    """Function f(xp, *arguments) -> tuple of scalars; common subexpressions are computed once.

    `xp` supplies sin, cos, ...; constants are evaluated to floats beforehand, because the torch
    code of sympy.lambdify fails on integer powers of integers, square roots and constants.

    >>> import numpy as np, sympy as sp
    >>> x = sp.Symbol("x")
    >>> scalar_code([x], [sp.sqrt(4) * x**2, sp.cos(x)])(np, 3.0)[0]
    18.0
    """
    outputs = [sp.N(sp.sympify(e)) for e in outputs]
    shared, results = sp.cse(outputs, symbols=_fresh(), list=True)
    printer = _Printer()
    used = set().union(*(e.atoms(sp.Function) for e in outputs))
    lines = [f"    {f} = xp.{f}" for f in sorted({type(e).__name__ for e in used})]
    lines += [f"    {name} = {printer.doprint(e)}" for name, e in shared]
    body = ", ".join(printer.doprint(e) for e in results)
    names = ", ".join(str(a) for a in arguments)
    source = f"def equations(xp, {names}):\n" + "\n".join(lines) + f"\n    return ({body},)\n"
    scope: dict[str, Any] = {}
    exec(compile(source, "<equations of motion>", "exec"), scope)
    return scope["equations"]


def _fresh() -> Iterator[sp.Symbol]:
    return sp.numbered_symbols("_s")
